"""Pages of the environments and the code say the same."""

import pytest

from docs.make_pages import all_pages, contents, empty_page, path_of, written

PAGES = contents()


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_page_says_what_the_code_does(path):
    """`python -m docs.make_pages` writes it anew."""
    assert path.read_text() == PAGES[path]


def test_an_id_without_a_page_gets_one_with_all_its_sections():
    page = all_pages()[0]
    text = written(page, None)
    assert set(page.sections()) < {line[3:] for line in text.splitlines() if line.startswith("## ")}
    assert all(section in text for section in page.sections().values())
    assert empty_page(page).count("\n## ") == path_of(page).read_text().count("\n## ")
