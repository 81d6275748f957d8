# SPDX-License-Identifier: MIT
"""Are the files of an ensemble what the program left? Seals and digests (XXH3, 128 bits) as src/base/checksum.h and
src/run/ensemble_record.h have them.

The digest is made by libxxhash, which the program itself is linked to, or by the Python package xxhash. On a machine
that has neither nothing can be checked, and available() says so.
"""
import ctypes
import ctypes.util
import mmap
import stat

MAGIC = b"bergtow sealed file\n"
SEAL_BYTES = 128
FILES = ("summary.json", "result.h5", "case.resolved.yml")


class _Hash(ctypes.Structure):
    _fields_ = [("low", ctypes.c_uint64), ("high", ctypes.c_uint64)]


def _library():
    for name in ("libxxhash.so.0", ctypes.util.find_library("xxhash")):
        try:
            function = ctypes.CDLL(name).XXH3_128bits
        except (OSError, AttributeError, TypeError):
            continue
        function.restype, function.argtypes = _Hash, [ctypes.c_void_p, ctypes.c_size_t]
        return function
    return None


_XXH3 = _library()
try:
    import xxhash
except ImportError:
    xxhash = None


#: why not, and what to do
MISSING = "this machine has neither libxxhash nor the Python package xxhash: install libxxhash0"


def available():
    """Can digests be made on this machine?"""
    return _XXH3 is not None or xxhash is not None


def digest(data):
    """Hexadecimal digest of bytes, or of a buffer that may be written to."""
    if _XXH3 is None:
        return xxhash.xxh3_128_hexdigest(data)
    found = _XXH3(data, len(data)) if isinstance(data, bytes) else _XXH3(
        ctypes.addressof(ctypes.c_char.from_buffer(data)), len(data))
    return f"{found.high:016x}{found.low:016x}"


def _of_file(path, seal=0):
    """(length, digest) of what stands before the last `seal` bytes. Errors: OSError; ValueError for what is no regular
    file."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise ValueError("is no regular file")
    with open(path, "rb") as f:
        size = f.seek(0, 2) - seal
        if size <= 0:
            return 0, digest(b"")
        with mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_COPY) as data:  # copied where written to, and nothing is
            view = memoryview(data)[:size]
            try:
                return size, digest(view)
            finally:
                view.release()


def broken_seal(path, kind):
    """Why a sealed file of this kind ("ensemble 2") is not what the program wrote, or None. Errors: OSError."""
    size, found = _of_file(path, SEAL_BYTES)
    with open(path, "rb") as f:
        f.seek(size)
        seal = f.read()
    if not seal.startswith(MAGIC):
        return f"is no {kind.split()[0]} under a seal of this program: damaged, or of an older version"
    wanted = MAGIC + f"kind: {kind}\nbytes: {size}\nxxh128: {found}\n".encode()
    return None if seal == wanted.ljust(SEAL_BYTES, b"\0") else "is damaged: its bytes do not fit their seal"


def record(folder, name, study):
    """The record that the files of a member ask for; study: text of study.resolved.yml. Errors: OSError, ValueError."""
    lines = ["bergtow finished member 1", f"name: {name}", f"study: {digest(study)}"]
    for file in FILES:
        try:
            size, found = _of_file(folder / file)
        except FileNotFoundError:
            raise ValueError(f"{file} is missing") from None
        except ValueError as error:
            raise ValueError(f"{file} {error}") from None
        lines.append(f"{file}: {size} bytes, xxh128 {found}")
    return "\n".join(lines) + "\n"


def stamp(folder):
    """What tells that no file of a finished member has changed since it was looked at; None where one is missing."""
    try:
        some = [(folder / file).stat() for file in (*FILES, "finished")]
    except OSError:
        return None
    return [(s.st_ino, s.st_size, s.st_mtime_ns, s.st_ctime_ns) for s in some]


def keep(folder, name, study):
    """Write the record of a run that has just finished in a folder, under a temporary name first; none where digests
    cannot be made. Errors: OSError, ValueError."""
    if not available():
        return
    part = folder / "finished.tmp"
    part.write_text(record(folder, name, study), encoding="utf-8")
    part.replace(folder / "finished")


def fault_of_member(folder, name, study):
    """Why the files of a finished member are not what it left, or None."""
    try:
        if not stat.S_ISREG((folder / "finished").stat().st_mode):
            return "its record `finished` is no regular file"
        kept = (folder / "finished").read_bytes()
        wanted = record(folder, name, study).encode()
    except FileNotFoundError:
        return "its record `finished` is missing"
    except (OSError, ValueError) as error:
        return str(error)
    if kept == wanted:
        return None
    have, want = kept.splitlines(), wanted.splitlines()
    changed = [
        line.split(b":")[0].decode(errors="replace") for k, line in enumerate(want) if k >= len(have) or have[k] != line
    ]
    if have[:1] == want[:1] and {"name", "study"} & set(changed):
        return "its record `finished` is of another run"
    return (f"{' and '.join(changed[:3])} changed since it finished" if have[:1] == want[:1] and changed else
            "its record `finished` is damaged, or of an older version of the program")
