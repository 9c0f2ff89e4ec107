"""Signals that a library sets for itself are set back."""

import os
import signal
import subprocess
import sys

import pytest

SCRIPT = """
import ctypes, faulthandler, os, signal, threading
from qvi_contact.basics.signals import handlers_kept

heard = []
signal.signal(signal.SIGTERM, lambda *_: heard.append("SIGTERM"))
faulthandler.enable()

def careless():
    with handlers_kept():
        for number in (signal.SIGPIPE, signal.SIGTERM, signal.SIGSEGV):
            assert library.signal(int(number), None) != -1

library = ctypes.CDLL(None)
library.signal.argtypes, library.signal.restype = (ctypes.c_int, ctypes.c_void_p), ctypes.c_ssize_t
thread = threading.Thread(target=careless)
thread.start()
thread.join()
os.kill(os.getpid(), signal.SIGTERM)
reading, writing = os.pipe()
os.close(reading)
try:
    os.write(writing, b"nobody reads this")
except BrokenPipeError:
    print(heard, flush=True)
os.kill(os.getpid(), signal.SIGSEGV)
"""


@pytest.mark.skipif(os.name != "posix", reason="there is nothing to keep")
def test_handlers_are_kept_in_any_thread_and_not_only_those_of_python():
    words = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stdout == "['SIGTERM']\n", done
    assert done.returncode == -signal.SIGSEGV
    assert "Segmentation fault" in done.stderr  # of faulthandler
