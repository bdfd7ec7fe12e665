"""Compiles exported controllers and runs them: in this process, or as a program that reads measurements."""

import ctypes
import shutil
import subprocess
import sys

import numpy as np

ZIG = [sys.executable, "-m", "ziglang", "cc"]
CC = [shutil.which("cc")] if shutil.which("cc") else ZIG
WARNINGS = [
    "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Wdouble-promotion", "-Wvla",
    "-Wframe-larger-than=8192", "-Werror",
]  # fmt: skip
STRICT = ["-std=c99", "-O2", *WARNINGS]
# Undefined behaviour and addresses out of bounds end the program; the wheel has no run time for the latter.
SANITIZERS = ["-O0", "-fsanitize=undefined", "-fno-sanitize-recover=all"]
SANITIZERS += [] if "ziglang" in CC else ["-fsanitize=address"]
ALLOCATORS = ("malloc", "calloc", "realloc", "free", "aligned_alloc")

# Reads measurements and writes outcome, command, until the input ends.
PLAYER = """
#include "controller.h"
#include <stdio.h>
int main(void)
{
    static double measurement[TENSCTL_MEASUREMENT], answer[1 + TENSCTL_INPUTS];
    while (fread(measurement, sizeof measurement[0], TENSCTL_MEASUREMENT, stdin) == TENSCTL_MEASUREMENT) {
        answer[0] = tensctl_step(measurement, answer + 1);
        fwrite(answer, sizeof answer[0], 1 + TENSCTL_INPUTS, stdout);
    }
    return 0;
}
"""


class Report(ctypes.Structure):
    """`struct tensctl_report`."""

    _fields_ = [
        ("outcome", ctypes.c_int),
        ("iterations", ctypes.c_int),
        ("kkt", ctypes.c_double),
        ("relaxed", ctypes.c_double),
    ]


class Compiled:
    """An exported controller in this process, optimised a little: `-O2` takes two and a half times as long to build."""

    def __init__(self, source, inputs, level="-Og"):
        self.inputs = inputs
        library = source.with_suffix(".so")
        build([source], library, "-shared", "-fPIC", level)
        self._c = ctypes.CDLL(str(library))
        self._c.tensctl_last.restype = Report
        self.reset = self._c.tensctl_reset

    def step(self, measurement):
        """Outcome and command."""
        pointer = ctypes.POINTER(ctypes.c_double)
        shown, u = np.ascontiguousarray(measurement, float), np.full(self.inputs, np.nan)
        outcome = self._c.tensctl_step(shown.ctypes.data_as(pointer), u.ctypes.data_as(pointer))
        assert self.last.outcome == outcome
        return outcome, u

    def numbers(self, name, count, *given):
        """So many that a function of the source points at, told what is given."""
        function = self._c[name]
        function.restype = ctypes.POINTER(ctypes.c_double)
        return np.array(function(*given)[:count])

    @property
    def last(self):
        return self._c.tensctl_last()


def build(sources, target, *flags):
    """Compile with every warning an error, and link."""
    subprocess.run([*CC, *STRICT, *flags, "-o", str(target), *map(str, sources), "-lm"], check=True)


def links(sources, target, *flags):
    """Whether sources compile and link."""
    command = [*CC, *STRICT, *flags, "-o", str(target), *map(str, sources), "-lm"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def sanitized(folder):
    """A program that plays measurements to the controller in a folder, under the sanitizers."""
    (folder / "main.c").write_text(PLAYER)
    build([folder / "main.c", folder / "controller.c"], folder / "main", *SANITIZERS)
    return folder / "main"


def zig_compiles(source):
    """The compiler of the wheel has no complaint either, nor any of its warnings."""
    subprocess.run([*ZIG, *STRICT, "-O0", "-c", str(source), "-o", str(source.with_suffix(".zig.o"))], check=True)


def played(program, measurements):
    """Outcomes and commands of the program for measurements, (steps, .)."""
    done = subprocess.run([str(program)], input=measurements.tobytes(), capture_output=True, check=True)
    answers = np.frombuffer(done.stdout).reshape(len(measurements), -1)
    return answers[:, 0].astype(int), answers[:, 1:]


def flat(measurement):
    """A measurement as the C source of a state controller reads it."""
    return np.concatenate([measurement.nodes.ravel(), measurement.velocities.ravel(), measurement.inputs])
