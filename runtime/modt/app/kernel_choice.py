"""Choice of the kernels that the pipeline runs on."""

from __future__ import annotations

import logging
import os

from modt.config.stages import KERNELS, NATIVE
from modt.config.stages import NUMPY as NUMPY_NAME
from modt.errors import MisuseError
from modt.native.library import NotAvailableError, load
from modt.segmentation.kernels import NUMPY, Kernels
from modt.segmentation.native_kernels import NativeKernels

VARIABLE = "MODT_KERNELS"
log = logging.getLogger(__name__)


def choose(wanted: str) -> Kernels:
    """The kernels of a name in KERNELS, or of that in the environment.

    Raises:
        MisuseError: the name is unknown, or the compiled ones are asked for and cannot be used.
    """
    name = os.environ.get(VARIABLE) or wanted
    if name not in KERNELS:
        raise MisuseError(VARIABLE, f"no kernels {name!r}", f"use one of: {', '.join(KERNELS)}")
    if name == NUMPY_NAME:
        return NUMPY
    try:
        return NativeKernels(*load())
    except NotAvailableError as error:
        if name == NATIVE:
            raise MisuseError("segmentation.kernels", f"native: {error}", f"or use {NUMPY_NAME}") from None
        log.warning("the passes over points run on NumPy: a frame takes about half as long again: %s", error)
        return NUMPY
