"""A disk that answers errors: calls of processes on files below a folder fail with an errno, as on a share.

A library that is loaded first (LD_PRELOAD) stands before the C library. What fails, and with what, lies in a file that
it maps into memory: an int for each kind of call, 0 where the call passes.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from pathlib import Path

CALLS = ("open", "read", "write", "sync", "rename", "unlink", "stat", "close", "truncate")
_SOURCE = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>
enum { OPEN, READ, WRITE, SYNC, RENAME, UNLINK, STAT, CLOSE, TRUNCATE, CALLS };
static volatile int *answer;
static const char *prefix;
static char below[65536];
static void begin(void)
{
    if (answer != NULL)
        return;
    static int none[CALLS];
    answer = none;  /* until the map is there, also for the calls made here */
    const char *name = getenv("REFUSALS_FILE");
    prefix = getenv("REFUSALS_PREFIX");
    int (*open_)(const char *, int, ...) = dlsym(RTLD_NEXT, "open");
    int file = name && prefix ? open_(name, O_RDONLY | O_CLOEXEC) : -1;
    void *map = file < 0 ? MAP_FAILED : mmap(NULL, sizeof none, PROT_READ, MAP_SHARED, file, 0);
    if (file >= 0)
        close(file);
    if (map != MAP_FAILED)
        answer = map;
}
static int named(const char *path)
{
    begin();
    return prefix != NULL && path != NULL && strncmp(path, prefix, strlen(prefix)) == 0;
}
static int fails(int call, int ours)
{
    begin();
    if (!ours || !answer[call])
        return 0;
    errno = answer[call];
    return 1;
}
#define BELOW(file) ((file) >= 0 && (file) < (int)sizeof below && below[file])
#define OPENS(name) \\
    int name(const char *path, int flags, ...) \\
    { \\
        static int (*next)(const char *, int, ...); \\
        if (!next) next = dlsym(RTLD_NEXT, #name); \\
        va_list more; va_start(more, flags); mode_t mode = va_arg(more, mode_t); va_end(more); \\
        int ours = named(path); \\
        if (fails(OPEN, ours)) return -1; \\
        int file = next(path, flags, mode); \\
        if (file >= 0 && file < (int)sizeof below) below[file] = ours; \\
        return file; \\
    }
OPENS(open)
OPENS(open64)
#define ON_FILE(result, name, call, declared, passed) \\
    result name declared \\
    { \\
        static result (*next) declared; \\
        if (!next) next = dlsym(RTLD_NEXT, #name); \\
        return fails(call, BELOW(file)) ? -1 : next passed; \\
    }
ON_FILE(ssize_t, read, READ, (int file, void *to, size_t size), (file, to, size))
ON_FILE(ssize_t, pread, READ, (int file, void *to, size_t size, off_t at), (file, to, size, at))
ON_FILE(ssize_t, pread64, READ, (int file, void *to, size_t size, off64_t at), (file, to, size, at))
ON_FILE(ssize_t, write, WRITE, (int file, const void *from, size_t size), (file, from, size))
ON_FILE(ssize_t, pwrite, WRITE, (int file, const void *from, size_t size, off_t at), (file, from, size, at))
ON_FILE(ssize_t, pwrite64, WRITE, (int file, const void *from, size_t size, off64_t at), (file, from, size, at))
ON_FILE(int, fsync, SYNC, (int file), (file))
ON_FILE(int, fdatasync, SYNC, (int file), (file))
ON_FILE(int, ftruncate, TRUNCATE, (int file, off_t size), (file, size))
ON_FILE(int, ftruncate64, TRUNCATE, (int file, off64_t size), (file, size))
ON_FILE(int, fstat, STAT, (int file, struct stat *to), (file, to))
ON_FILE(int, fstat64, STAT, (int file, struct stat64 *to), (file, to))
#define ON_PATH(name, call, declared, passed) \\
    int name declared \\
    { \\
        static int (*next) declared; \\
        if (!next) next = dlsym(RTLD_NEXT, #name); \\
        return fails(call, named(path)) ? -1 : next passed; \\
    }
ON_PATH(rename, RENAME, (const char *path, const char *to), (path, to))
ON_PATH(unlink, UNLINK, (const char *path), (path))
ON_PATH(stat, STAT, (const char *path, struct stat *to), (path, to))
ON_PATH(stat64, STAT, (const char *path, struct stat64 *to), (path, to))
int close(int file)
{
    static int (*next)(int);
    if (!next) next = dlsym(RTLD_NEXT, "close");
    int ours = BELOW(file);
    if (ours) below[file] = 0;
    int result = next(file);
    return result == 0 && fails(CLOSE, ours) ? -1 : result;  /* closed all the same, as the kernel does it */
}
"""


def missing() -> str:
    """Why disks cannot answer errors here, else empty."""
    return "" if shutil.which("cc") else "a C compiler is needed"


class Refusals:
    """What calls on files below `folder` answer, of processes with this environment."""

    def __init__(self, file: Path, folder: Path) -> None:
        """`file`: what the library reads; a C compiler is needed."""
        self._file, self._library, self._folder = file, file.with_name(f"{file.name}.so"), folder
        command = ["cc", "-shared", "-fPIC", "-O1", "-x", "c", "-", "-ldl", "-o", str(self._library)]
        subprocess.run(command, input=_SOURCE.encode(), check=True)
        file.write_bytes(bytes(4 * len(CALLS)))

    def environment(self, preload: str = "") -> dict[str, str]:
        """Of the processes; `preload`: other libraries that are loaded first."""
        libraries = f"{self._library}:{preload}" if preload else str(self._library)
        return {"LD_PRELOAD": libraries, "REFUSALS_FILE": str(self._file), "REFUSALS_PREFIX": f"{self._folder}/"}

    def answer(self, errno: int, *calls: str) -> None:
        """From now on these calls fail with `errno`, all others pass. 0: nothing fails any more."""
        content = struct.pack(f"{len(CALLS)}i", *(errno if call in calls else 0 for call in CALLS))
        with open(self._file, "r+b", buffering=0) as file:
            os.pwrite(file.fileno(), content, 0)
