"""matplotlib as this project draws with it: no window, its own defaults, and every failure one sentence.

Figures are made outside pyplot, and so need no backend. What a notebook, a `matplotlibrc` or a `$` in a name would have
matplotlib do (another backend, LaTeX, a formula) is none of a report's business.
"""

from __future__ import annotations

import contextlib
import functools
import io
import os
import sys
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import ParamSpec, TypeVar

from rw_ekf.errors import PictureError, RwEkfError

P = ParamSpec("P")
T = TypeVar("T")

_CALLED_BY_PIP = {"PIL": "pillow", "dateutil": "python-dateutil", "mpl_toolkits": "matplotlib"}


def picture(function: Callable[P, T]) -> Callable[P, T]:
    """Let a function draw by matplotlib's defaults, with texts as they stand.

    Raises PictureError for whatever matplotlib fails of: nobody loses what the picture shows for the picture.
    """

    @functools.wraps(function)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            with _defaults():
                found = function(*args, **kwargs)
                _let_notebooks_show_figures()
                return found
        except (RwEkfError, MemoryError):
            raise
        except ImportError as error:  # all but pictures works without it, where there is none for a machine
            raise PictureError(f"the picture cannot be drawn: {_not_imported(error)}") from error
        except Exception as error:
            reason = str(error).strip().split("\n")[0]
            raise PictureError(f"the picture cannot be drawn ({type(error).__name__}: {reason[:200]})") from error

    return drawn


def _not_imported(error: ImportError) -> str:
    """What to install, or to install again, so that pictures can be drawn."""
    module = (error.name or "matplotlib").partition(".")[0]
    package = _CALLED_BY_PIP.get(module, module)
    if isinstance(error, ModuleNotFoundError) and error.name == module:
        return f"{package} is not installed: pip install {package}"
    reason = str(error).strip().split("\n")[0][:200]
    return f"{package} is damaged ({reason}): pip install --force-reinstall {package}"


def _let_notebooks_show_figures() -> None:
    """A figure that no pyplot made is shown by a notebook as a picture, not as its name, once it has a formatter."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is None or shell.display_formatter is None:
        return
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    formatter = shell.display_formatter.formatters["image/png"]

    def png(figure: Figure) -> bytes:
        buffer = io.BytesIO()
        FigureCanvasAgg(figure)
        figure.savefig(buffer, format="png")
        return buffer.getvalue()

    try:
        formatter.lookup_by_type(Figure)
    except KeyError:
        formatter.for_type(Figure, png)


@contextlib.contextmanager
def _defaults() -> Iterator[None]:
    mpl = _matplotlib()
    own = {key: value for key, value in mpl.rcParamsDefault.items() if key != "backend"}
    with mpl.rc_context({**own, "text.parse_math": False}):
        yield


def _matplotlib() -> ModuleType:
    """Import matplotlib; one that does not know the backend named in MPLBACKEND would refuse to be imported."""
    if "matplotlib" in sys.modules:
        return sys.modules["matplotlib"]
    wanted = os.environ.pop("MPLBACKEND", None)
    try:
        import matplotlib as mpl
    finally:
        if wanted is not None:
            os.environ["MPLBACKEND"] = wanted
    if wanted is not None:
        with contextlib.suppress(ValueError):
            mpl.rcParams["backend"] = wanted  # whoever draws with pyplot in this process gets the backend requested
    return mpl
