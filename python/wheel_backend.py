"""Builds the wheel of this folder (PEP 517): pure Python and the .lcm files, zipped.

setuptools would do the same, but pip fetches it from the network for each build, and a car's computer has none.
"""
import base64
import hashlib
import zipfile
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
NAME, TAG = "roadfix_log", "py3-none-any"


def _project():
    """The strings of [project]; pyproject.toml has nothing more complicated there."""
    out, inside = {}, False
    for line in (FOLDER / "pyproject.toml").read_text().splitlines():
        if line.startswith("["):
            inside = line.strip() == "[project]"
        elif inside and "=" in line:
            key, value = (part.strip() for part in line.split("=", 1))
            out[key] = value.strip('"')
    return out


def _metadata(project):
    return (f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
            f"Summary: {project['description']}\nRequires-Python: {project['requires-python']}\nRequires-Dist: numpy\n")


def _write_wheel(folder, files):
    project = _project()
    info = f"{NAME}-{project['version']}.dist-info"
    files = {**files, f"{info}/METADATA": _metadata(project).encode(),
             f"{info}/WHEEL": f"Wheel-Version: 1.0\nGenerator: {NAME}\nRoot-Is-Purelib: true\nTag: {TAG}\n".encode()}
    record = []
    wheel = f"{NAME}-{project['version']}-{TAG}.whl"
    with zipfile.ZipFile(Path(folder) / wheel, "w", zipfile.ZIP_DEFLATED) as out:
        for name, data in files.items():
            out.writestr(name, data)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            record.append(f"{name},sha256={digest},{len(data)}\n")
        out.writestr(f"{info}/RECORD", "".join(record) + f"{info}/RECORD,,\n")
    return wheel


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    package = FOLDER / NAME
    types = package / "lcmtypes"  # a link to the repository's: what is installed has copies
    if not list(types.glob("*.lcm")):
        raise SystemExit(f"{types}: no .lcm files: build from a checkout of Roadfix")
    paths = [*package.glob("*.py"), *types.glob("*.lcm"), *types.glob("released/*/*.lcm")]
    return _write_wheel(wheel_directory, {str(path.relative_to(FOLDER)): path.read_bytes() for path in sorted(paths)})


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    return _write_wheel(wheel_directory, {f"{NAME}.pth": f"{FOLDER}\n".encode()})


def build_sdist(sdist_directory, config_settings=None):
    raise SystemExit(f"{NAME}: there is no source archive; the checkout is it")
