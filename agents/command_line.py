"""How the command lines end: a sentence in place of a traceback where the user can do something about it."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator

import gymnasium


@contextlib.contextmanager
def one_sentence() -> Iterator[None]:
    """Print what is wrong with the input, the disk or the memory and exit with code 2; after Ctrl-C with code 130."""
    try:
        yield
    except OSError as error:
        what = error.strerror or str(error) or type(error).__name__
        where = f" ({error.filename})" if error.filename else ""
        sentence = f"files must be readable and writable, but got {what!r}{where}: make room or choose another folder."
    except MemoryError as error:
        sentence = (
            f"the memory must hold all rods and their rollouts, but got {str(error) or 'none'!r}: use fewer rods."
        )
    except (ValueError, gymnasium.error.Error) as error:
        sentence = str(error)
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    else:
        return
    print(f"error: {sentence}", file=sys.stderr)
    raise SystemExit(2)
