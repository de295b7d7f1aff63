"""An object store on this machine that speaks as much of S3 as reading logs takes: list, head and get. It checks no credentials."""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from email.utils import formatdate
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.parse import parse_qs, unquote, urlsplit
from xml.sax.saxutils import escape

CHANGED = 1.7e9  # when all objects changed [s since 1970]
FIELD = "http://s3.amazonaws.com/doc/2006-03-01/"


def _tag(content: bytes) -> str:
    return f'"{hashlib.md5(content, usedforsecurity=False).hexdigest()}"'


def _listing(bucket: str, objects: Mapping[str, bytes], asked: Mapping[str, str]) -> str:
    """Return the answer to ListObjectsV2, all keys at once."""
    prefix, delimiter = asked.get("prefix", ""), asked.get("delimiter", "")
    rows, folders = "", set()
    for key in sorted(key for key in objects if key.startswith(prefix)):
        below = key[len(prefix) :]
        if delimiter and delimiter in below:
            folders.add(prefix + below.partition(delimiter)[0] + delimiter)
            continue
        rows += (
            f"<Contents><Key>{escape(key)}</Key><LastModified>2023-11-14T22:13:20.000Z</LastModified>"
            f"<ETag>{escape(_tag(objects[key]))}</ETag><Size>{len(objects[key])}</Size></Contents>"
        )
    rows += "".join(
        f"<CommonPrefixes><Prefix>{escape(one)}</Prefix></CommonPrefixes>" for one in sorted(folders)
    )
    return (
        f'<ListBucketResult xmlns="{FIELD}"><Name>{bucket}</Name><IsTruncated>false</IsTruncated>'
        f"<KeyCount>{len(objects)}</KeyCount>{rows}</ListBucketResult>"
    )


@contextmanager
def served(bucket: str, objects: Mapping[str, bytes]) -> Iterator[str]:
    """Yield the address of a store with one bucket of objects, by key, that is gone afterwards."""

    class Answer(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def answer(self, status: int, body: bytes, **headers: str) -> None:
            self.send_response(status)
            for name, value in ({"Content-Length": str(len(body))} | headers).items():
                self.send_header(name.replace("_", "-"), value)
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(body)

        def do_GET(self) -> None:
            url = urlsplit(self.path)
            asked = {name: values[0] for name, values in parse_qs(url.query).items()}
            where, _, key = unquote(url.path).lstrip("/").partition("/")
            if where != bucket or (key and key not in objects):
                code = "NoSuchBucket" if where != bucket else "NoSuchKey"
                self.answer(
                    404, f"<Error><Code>{code}</Code></Error>".encode(), Content_Type="application/xml"
                )
            elif not key:
                listed = _listing(bucket, objects, asked).encode()
                self.answer(200, listed, Content_Type="application/xml")
            else:
                content, part = objects[key], self.headers.get("Range", "")
                about = {"ETag": _tag(content), "Last_Modified": formatdate(CHANGED, usegmt=True)}
                first, _, last = part.removeprefix("bytes=").partition("-")
                if part:
                    end = min(int(last or len(content) - 1), len(content) - 1)
                    about["Content_Range"] = f"bytes {first}-{end}/{len(content)}"
                    self.answer(206, content[int(first) : end + 1], **about)
                elif self.command == "HEAD":
                    self.answer(200, b"", **about | {"Content_Length": str(len(content))})
                else:
                    self.answer(200, content, **about)

        do_HEAD = do_GET

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Answer)
    server.daemon_threads = True
    Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()
