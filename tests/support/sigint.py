"""Ctrl-C at a moment of the program."""

import os
import signal


def press_ctrl_c(monkeypatch, owner, name, call=1):
    """Has SIGINT arrive in the call of that number of a function, before it does its work."""
    real, calls = getattr(owner, name), []

    def pressed(*arguments, **named):
        calls.append(1)
        if len(calls) == call:
            os.kill(os.getpid(), signal.SIGINT)
        return real(*arguments, **named)

    monkeypatch.setattr(owner, name, pressed)
