"""Write what the code decides into the environments' pages: `python -m docs.make_pages` from the root of a checkout.

Description, example and version history of a page are written by hand. An id without a page gets one to fill in.
"""

from __future__ import annotations

import re
from pathlib import Path

from docs.page_sections import Page, table
from magrod_env.envs.tasks import TASKS

FOLDER = Path(__file__).parent
LIST = ("id", "task", "field along", "observation", "time limit")
EXAMPLE = """import gymnasium
import magrod_env  # registers the ids

env = gymnasium.make("{name}")
observation, info = env.reset(seed=0)
observation, reward, terminated, truncated, info = env.step(env.action_space.sample())"""


def all_pages() -> list[Page]:
    """Every id of every task."""
    return [Page.of(one, spec) for spec in TASKS.values() for one in spec.ids]


def path_of(page: Page) -> Path:
    """Where a page is kept."""
    return FOLDER / "environments" / f"{page.name}.md"


def written(page: Page, text: str | None) -> str:
    """The text of a page with the code's sections in it; `text` is the page before, None where there is none."""
    text = empty_page(page) if text is None else text
    for heading, body in page.sections().items():
        text = re.sub(rf"(?ms)^## {heading}\n.*?(?=^## )", lambda _: f"## {heading}\n\n{body}\n\n", text)  # noqa: B023
    return text


def empty_page(page: Page) -> str:
    """A page with headings, the summary and an example."""
    example = f"```python\n{EXAMPLE.format(name=page.one.name)}\n```"
    by_hand = {"Description": f"{page.one.summary}.", "Example": example, "Version history": "v0: first release."}
    headings = ("Description", *page.sections(), "Example", "Version history")
    return f"# {page.one.name}\n\n" + "\n".join(f"## {name}\n\n{by_hand.get(name, '')}\n" for name in headings)


def listed(pages: list[Page], text: str) -> str:
    """docs/environments.md with the list of all ids."""
    rows = [
        (
            f"[{page.one.name}](environments/{page.name}.md)",
            page.one.summary,
            ", ".join(page.env.coils.axes),
            f"{page.env.observation_layout.size}{', and two goals' if page.one.goal else ''}",
            f"{page.one.max_episode_steps} steps, {page.seconds:g} s",
        )
        for page in pages
    ]
    return re.sub(r"(?ms)^\| id \|.*?(?=^$)", lambda _: f"{table(LIST, rows)}\n", text, count=1)


def contents() -> dict[Path, str]:
    """What every file should hold."""
    pages = all_pages()
    files = {}
    for page in pages:
        path = path_of(page)
        files[path] = written(page, path.read_text() if path.is_file() else None)
    overview = FOLDER / "environments.md"
    return files | {overview: listed(pages, overview.read_text())}


def main() -> None:
    """Write the files."""
    for path, text in contents().items():
        path.write_text(text)
        print(path)


if __name__ == "__main__":
    main()
