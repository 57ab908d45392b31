"""Buckets: read in place as folders are, by a double of the two calls and by a server of S3."""

from __future__ import annotations

import errno
import importlib
import importlib.util
import io
import multiprocessing
import os
import pickle
import random
import zipfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

from pnabs import settings
from pnabs.batch import InvalidInput
from pnabs.dataset import catalogue, s3, s3_client
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.source import Dataset
from pnabs.stages.ingest import IngestTask

from .conftest import MESH

pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning:botocore.*"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:aiobotocore.*"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:moto.*"),
]

MAX = 10_000
CUBE = b"""v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
f 1 3 2
f 1 4 3
f 5 6 7
f 5 7 8
f 1 2 6
f 1 6 5
f 2 3 7
f 2 7 6
f 3 4 8
f 3 8 7
f 4 1 5
f 4 5 8
"""

Put = Callable[[str, bytes], None]


class Double:
    """A bucket `corpus` in memory, as the two calls show it."""

    def __init__(self) -> None:
        self.content: dict[str, bytes] = {}

    def pages(
        self, bucket: str, prefix: str, delimiter: str = "", limit: int = 1000
    ) -> Iterator[s3_client.Page]:
        if bucket != "corpus":
            raise OSError(errno.EIO, "NoSuchBucket: it does not exist", bucket)
        found: dict[str, s3_client.Object | None] = {}
        for key in sorted(self.content):
            if key.startswith(prefix):
                head, cut, _ = key[len(prefix) :].partition(delimiter or "\0")
                found[f"{prefix}{head}{cut}"] = None if cut else self._object(key)
        items = list(found.items())
        for start in range(0, max(len(items), 1), limit):
            part = items[start : start + limit]
            yield s3_client.Page(
                [item for _, item in part if item], [name for name, item in part if item is None]
            )

    def get(self, bucket: str, key: str, check: Callable[[int], None], **conditions: str) -> bytes:
        if key not in self.content:
            raise OSError(errno.ENOENT, "NoSuchKey", key)
        if conditions.get("IfMatch", self._object(key).etag) != self._object(key).etag:
            raise OSError(errno.ESTALE, "PreconditionFailed", key)
        data = self.content[key]
        if "Range" in conditions:
            first, last = conditions["Range"].removeprefix("bytes=").split("-")
            data = data[int(first) : int(last) + 1]
        check(len(data))
        return data

    def _object(self, key: str) -> s3_client.Object:
        data = self.content[key]
        return s3_client.Object(key, len(data), 1_700_000_000_000_000_000, str(hash(data)))


@pytest.fixture(autouse=True)
def no_known_roots() -> None:
    """Each test has a bucket of its own, under one name."""
    s3._is_archive.cache_clear()


@pytest.fixture
def new_client() -> Iterator[None]:
    """A client made in this test, of its environment, and used in it alone."""
    s3_client._filesystem.cache_clear()
    yield
    s3_client._filesystem.cache_clear()


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """A server of S3 on this host."""
    moto = pytest.importorskip("moto.server", reason="needs moto[server]")
    pytest.importorskip("s3fs", reason="needs pnabs[s3]")
    started = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    started.start()
    host, port = started.get_host_and_port()
    yield f"http://{host}:{port}"
    started.stop()


@pytest.fixture
def served(server: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Put:
    """An empty bucket `corpus` of the server, and credentials for it."""
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    for name in ("AWS_PROFILE", "AWS_SESSION_TOKEN", "AWS_CA_BUNDLE", "HTTP_PROXY", "http_proxy"):
        monkeypatch.delenv(name, raising=False)
    for name in ("AWS_CONFIG_FILE", "AWS_SHARED_CREDENTIALS_FILE"):
        monkeypatch.setenv(name, str(tmp_path / "none"))
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setenv("AWS_ENDPOINT_URL", server)
    models = importlib.import_module("moto.s3.models")
    backend = models.s3_backends["123456789012"]["aws"]
    backend.reset()
    backend.create_bucket("corpus", "us-east-1")

    def put(key: str, data: bytes) -> None:
        backend.put_object("corpus", key, data)

    return put


@pytest.fixture(params=["double", "server"])
def put(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Put:
    """Put an object into the bucket `corpus`: of the double, then of the server."""
    if request.param == "server":
        served: Put = request.getfixturevalue("served")
        return served
    double = Double()
    monkeypatch.setattr(s3_client, "pages", double.pages)
    monkeypatch.setattr(s3_client, "get", double.get)
    return double.content.__setitem__


def _zip(members: Iterable[str], data: bytes = MESH) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for member in members:
            archive.writestr(member, data)
    return file.getvalue()


def _rows(root: str, layout: str) -> list[dict[str, object]]:
    job = settings.Dataset.model_validate({"root": root, "layout": layout})
    rows: list[dict[str, object]] = catalogue.scan(job, Path("/")).to_pylist()
    return rows


LAYOUTS = {
    "shapenet-v1": "{}/model.obj",
    "shapenet-v2": "{}/models/model_normalized.obj",
    "folder": "deep/er/{}.obj",
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_as_objects_as_zips_and_as_one_zip(put: Put, layout: str) -> None:
    names = [LAYOUTS[layout].format(model) for model in "abc"]
    for name in names:
        put(f"set/chair/{name}", MESH)
        put(f"set/chair/{name}.txt", b"no mesh")
    put("set/lamp.zip", _zip(f"lamp/{name}" for name in names))
    put("one.zip", _zip(f"{top}/{name}" for top in ("chair", "lamp") for name in names))
    put("settle/chair/other/model.obj", b"of another prefix")
    for root in ("s3://corpus/set", "s3://corpus/set/", "s3://corpus/one.zip"):
        rows = _rows(root, layout)
        assert [row["category"] for row in rows] == 3 * ["chair"] + 3 * ["lamp"]
        assert {row["size"] for row in rows} == {len(MESH)}
        assert all(row["reason"] == "" and int(str(row["mtime_ns"])) > 10**18 for row in rows)
        dataset = pickle.loads(pickle.dumps(Dataset(root)))
        assert {dataset.read(str(row["source"]), MAX) for row in rows} == {MESH}


def test_a_top_folder_and_a_whole_bucket(put: Put) -> None:
    put("Core/chair/a/model.obj", MESH)
    put("Core/chair/b/other.obj", MESH)
    rows = _rows("s3://corpus", "shapenet-v1")
    assert [row["source"] for row in rows] == ["Core/chair/a/model.obj", "Core/chair/b/model.obj"]
    assert rows[1]["reason"] == "Core/chair/b/model.obj: no such file"


def test_a_category_is_listed_in_bulk(put: Put, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(1_100):
        put(f"set/chair/{number:04d}/model.obj", MESH)
    asked = []
    pages = s3_client.pages

    def counted(*args: str, **options: int) -> Iterator[s3_client.Page]:
        asked.append(args)
        return pages(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(s3_client, "pages", counted)
    assert len(_rows("s3://corpus/set", "shapenet-v1")) == 1_100
    assert len(asked) < 10


def test_hostile_keys_are_seen_and_never_read(put: Put) -> None:
    put("secret.obj", b"secret")
    put("set/chair/good.obj", MESH)
    for key in ("chair/../up.obj", "chair//double.obj", "chair/./dot.obj", "chair/back\\slash.obj"):
        put(f"set/{key}", b"hostile")
    put("set//absolute.obj", b"hostile")
    put("set/chair/", b"")
    rows = {str(row["source"]): row for row in _rows("s3://corpus/set", "folder")}
    assert [source for source, row in rows.items() if not row["reason"]] == ["chair/good.obj"]
    assert len(rows) == 5
    dataset = Dataset("s3://corpus/set")
    for source in [*rows, "../secret.obj", "chair/../../secret.obj", "/absolute.obj", "", "chair/"]:
        if source != "chair/good.obj":
            with pytest.raises(SourceError):
                dataset.read(source, MAX)
            with pytest.raises(SourceError):
                dataset.stat(source)


def test_what_is_missing(put: Put) -> None:
    put("set/chair/a.obj", MESH)
    put("set/bad.zip", b"no zip file")
    dataset = Dataset("s3://corpus/set")
    for source in ("chair/b.obj", "chair", "chair/a", "none.zip!a.obj", "bad.zip!a.obj", "!a.obj"):
        for look in (lambda s: dataset.read(s, MAX), dataset.stat):
            with pytest.raises(SourceError):
                look(source)
    for place in ("lamp/", "chair/a.obj/", "none.zip!"):
        with pytest.raises(SourceError):
            dataset.list(place)


def test_the_limit_is_inclusive_and_comes_before_reading(put: Put) -> None:
    put("set/chair/a.obj", MESH)
    put("set/lamp.zip", _zip(["a.obj"]))
    for source in ("chair/a.obj", "lamp.zip!a.obj"):
        assert Dataset("s3://corpus/set").read(source, len(MESH)) == MESH
        with pytest.raises(SourceError, match="over the limit of"):
            Dataset("s3://corpus/set").read(source, len(MESH) - 1)


def test_siblings_stay_below_the_prefix(put: Put) -> None:
    put("set/chair/a/model.gltf", b"{}")
    put("set/chair/my part.bin", b"buffer")
    put("secret.bin", b"secret")
    read = Dataset("s3://corpus/set").sibling_reader("chair/a/model.gltf", MAX)
    assert read("../my part.bin") == read("../my%20part.bin") == b"buffer"
    for name in (
        "../../../secret.bin",
        "%2e%2e/%2e%2e/%2e%2e/secret.bin",
        "s3://corpus/secret.bin",
    ):
        with pytest.raises(SourceError):
            read(name)


def test_large_members_are_read_by_ranges(put: Put, monkeypatch: pytest.MonkeyPatch) -> None:
    data = bytes(range(256)) * 8_000
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("first.obj", data)
        archive.writestr("second.obj", data[::-1])
        archive.writestr("third.obj", MESH)
    put("one.zip", file.getvalue())
    fetched = []
    get = s3_client.get

    def counted(*args: object, **options: str) -> bytes:
        fetched.append(len(got := get(*args, **options)))  # type: ignore[arg-type]
        return got

    monkeypatch.setattr(s3_client, "get", counted)
    dataset = Dataset("s3://corpus/one.zip")
    assert dataset.read("!second.obj", 10**7) == data[::-1]
    assert sum(fetched) < len(data) + 2**20


def test_an_archive_that_changes_while_it_is_read(put: Put) -> None:
    large = random.Random(0).randbytes(600_000)  # more than the window that is read ahead
    put("set/lamp.zip", _zip(["b.obj"], large))
    dataset = Dataset("s3://corpus/set")
    assert dataset.stat("lamp.zip!b.obj")[0] == len(large)
    put("set/lamp.zip", _zip(["b.obj"]))
    with pytest.raises(OSError, match="PreconditionFailed") as caught:
        dataset.read("lamp.zip!b.obj", 10**6)
    assert caught.value.errno == errno.ESTALE
    assert Dataset("s3://corpus/set").read("lamp.zip!b.obj", MAX) == MESH


def _exit_with_what_is_read(dataset: Dataset) -> None:
    same = dataset.read("chair/a.obj", MAX) == dataset.read("lamp.zip!a.obj", MAX) == MESH
    os._exit(0 if same else 1)


def test_a_forked_process_has_connections_of_its_own(served: Put) -> None:
    served("set/chair/a.obj", MESH)
    served("set/lamp.zip", _zip(["a.obj"]))
    dataset = Dataset("s3://corpus/set")
    assert dataset.read("lamp.zip!a.obj", MAX) == MESH
    child = multiprocessing.get_context("fork").Process(
        target=_exit_with_what_is_read, args=(dataset,)
    )
    child.start()
    child.join(30)
    assert child.exitcode == 0


def test_ingest_reads_a_bucket(put: Put, tmp_path: Path) -> None:
    put("set/chair/a/model.obj", CUBE)
    put("set/chair/b/model.obj", b"no mesh")
    job = settings.Settings.model_validate(
        {
            "dataset": {"root": "s3://corpus/set", "layout": "shapenet-v1"},
            "out": tmp_path,
            "ingest": {"surface_points": 100, "interior_points": 100},
        }
    )
    first, second = _rows("s3://corpus/set", "shapenet-v1")
    _, fields = IngestTask(job)(first)
    assert fields.occupancy.any()
    with pytest.raises(InvalidInput, match="chair/b/model.obj"):
        IngestTask(job)(second)


@pytest.mark.parametrize("root", ["s3://nowhere", "s3://corpus/none", "s3://corpus/none.zip"])
def test_no_bucket_and_no_prefix(put: Put, root: str) -> None:
    put("nonesuch/a.obj", MESH)
    with pytest.raises(DatasetError, match=root):
        Dataset(root)


@pytest.mark.parametrize("root", ["s3://", "s3://b", "s3://corpus/a/../b", "s3://corpus//a"])
def test_what_is_no_url(root: str) -> None:
    with pytest.raises(DatasetError, match="s3://bucket/prefix"):
        Dataset(root)


@pytest.mark.skipif(importlib.util.find_spec("s3fs") is not None, reason="s3fs is installed")
def test_without_s3fs() -> None:
    with pytest.raises(DatasetError, match=r"install pnabs\[s3\]"):
        Dataset("s3://corpus/set")


@pytest.mark.usefixtures("new_client")
def test_no_credentials(served: Put, monkeypatch: pytest.MonkeyPatch) -> None:
    served("set/chair/a.obj", MESH)
    models = importlib.import_module("moto.s3.models")
    key = models.s3_backends["123456789012"]["aws"].get_object("corpus", "set/chair/a.obj")
    key.set_acl(models.get_canned_acl("public-read"))
    monkeypatch.delenv("AWS_ACCESS_KEY_ID")
    monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
    with pytest.raises(DatasetError, match="no credentials; set AWS_ACCESS_KEY_ID"):
        Dataset("s3://corpus/set")
    s3_client._filesystem.cache_clear()
    # What FSSPEC_S3_ANON=true leaves when fsspec is imported.
    monkeypatch.setitem(importlib.import_module("fsspec.config").conf, "s3", {"anon": "true"})
    assert Dataset("s3://corpus/set").read("chair/a.obj", MAX) == MESH


@pytest.mark.parametrize(
    ("code", "verdict"), [("AccessDenied", True), ("ExpiredToken", False), ("SlowDown", False)]
)
def test_what_is_refused_is_a_verdict_and_what_may_pass_is_none(
    served: Put, monkeypatch: pytest.MonkeyPatch, code: str, verdict: bool
) -> None:
    served("set/chair/a.obj", MESH)
    dataset = Dataset("s3://corpus/set")
    exceptions = importlib.import_module("botocore.exceptions")

    async def refuse(*_: object, **__: object) -> None:
        raise exceptions.ClientError({"Error": {"Code": code, "Message": "no"}}, "GetObject")

    filesystem = s3_client._filesystem(os.getpid())
    monkeypatch.setattr(filesystem._s3, "get_object", refuse)
    with pytest.raises(
        SourceError if verdict else OSError, match="permission" if verdict else code
    ):
        dataset.read("chair/a.obj", MAX)


@pytest.mark.usefixtures("new_client")
def test_no_server(served: Put, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(DatasetError, match="can't read s3://corpus"):
        Dataset("s3://corpus")
