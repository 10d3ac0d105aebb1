"""Ctrl-C and SIGTERM end a command wherever it is; where a library ignores what is raised, when it next reports its progress."""

import signal

_asked: list[BaseException] = []  # to end: empty, or the one exception that ends the command


def end_on_signals() -> None:
    """Let Ctrl-C raise KeyboardInterrupt and SIGTERM SystemExit, so that what is open is closed and viewers are ended."""
    _asked.clear()
    signal.signal(signal.SIGTERM, lambda *_: _end(SystemExit(143)))
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as a shell sets it for what runs in the background
        signal.signal(signal.SIGINT, lambda *_: _end(KeyboardInterrupt()))


def check_interrupted() -> None:
    """Raise what a signal raised before, where that was ignored: within a finalizer, Python prints an exception and goes on."""
    if _asked:
        raise _asked.pop()


def _end(by: BaseException) -> None:
    _asked[:] = [by]
    raise by
