"""What pyproject.toml cannot say: C libraries, configuration, units and examples inside the wheel."""

from __future__ import annotations

import platform
import shutil
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # a build backend does not have the project on its path

from acqd.c_builds import all_builds  # noqa: E402
from acqd.compiling import compile_shared, file_name, system_compiler  # noqa: E402

SHARED = {"config": "config", "systemd": "systemd", "examples": "docs/notebooks"}
"""Folders of acqd/share, and where they are in the source tree."""


class BuildPy(build_py):
    """Adds the shared files, and compiles all C libraries where there is a compiler."""

    def run(self) -> None:
        """Build the package."""
        super().run()
        if self.editable_mode:
            return  # files are used where they are, and C is compiled at first use
        package = Path(self.build_lib) / "acqd"
        for name, source in SHARED.items():
            if (HERE / source).is_dir():
                shutil.copytree(HERE / source, package / "share" / name, dirs_exist_ok=True)
        compiler = system_compiler()
        if compiler is None:
            self.warn("no C compiler: the wheel brings C along that is compiled at first use, if at all")
            return
        (package / "prebuilt").mkdir(exist_ok=True)
        for build in all_builds(platform.machine()):
            compile_shared(build, [compiler], package / "prebuilt" / file_name(build))


class Compiled(Distribution):
    """A wheel that holds compiled code belongs to its platform."""

    def has_ext_modules(self) -> bool:
        """Whether there is a compiler."""
        return system_compiler() is not None


class BdistWheel(bdist_wheel):
    """For any Python 3, since the libraries are loaded by ctypes."""

    def get_tag(self) -> tuple[str, str, str]:
        """For instance py3-none-linux_x86_64."""
        _, _, tag = super().get_tag()
        return "py3", "none", tag


setup(distclass=Compiled, cmdclass={"build_py": BuildPy, "bdist_wheel": BdistWheel})
