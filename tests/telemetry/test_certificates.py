"""When certificates end, as OpenSSL makes them."""

from __future__ import annotations

import subprocess
from datetime import UTC, datetime, timedelta

import pytest

from acqd.telemetry.certificates import of_file, trouble, validity


@pytest.fixture(scope="module", params=["20", "9999"])
def certificate(request, tmp_path_factory):
    """A file, and the days that it lasts; after 2050 the date has another form."""
    path = tmp_path_factory.mktemp("certificates") / "a.pem"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-subj", "/CN=a",
         "-days", request.param, "-keyout", path.with_suffix(".key"), "-out", path],
        check=True, capture_output=True,
    )  # fmt: skip
    return path, int(request.param)


def test_the_end_is_that_of_openssl(certificate):
    path, days = certificate
    told = subprocess.run(["openssl", "x509", "-enddate", "-noout", "-in", path], check=True, capture_output=True)
    expected = datetime.strptime(told.stdout.decode().strip(), "notAfter=%b %d %H:%M:%S %Y GMT").replace(tzinfo=UTC)
    assert of_file(path).ends == expected
    soon = min(30, days / 4)  # a program renews certificates of a short life, and not a month before their end
    now = (expected - timedelta(days=soon - 0.2)).timestamp()
    assert trouble([None, path], now).endswith(f"ends in {soon - 0.2:.0f} days, on {expected:%Y-%m-%d}")
    assert "has ended" in trouble([path], expected.timestamp() + 1) and not trouble([path], now - 0.4 * 86_400)


def test_files_that_are_none(certificate, tmp_path):
    (tmp_path / "key").write_text("-----BEGIN PRIVATE KEY-----\n")
    assert of_file(tmp_path / "key") is None and not trouble([tmp_path / "key"])
    (tmp_path / "cut").write_text("-----BEGIN CERTIFICATE-----\nMIIB\n-----END CERTIFICATE-----\n")
    assert "is no certificate" in trouble([tmp_path / "cut"]) and "No such file" in trouble([tmp_path / "none"])
    for data in (b"", b"0", b"0\x80", b"0\x02\x30\x00"):
        with pytest.raises(ValueError, match="is no certificate"):
            validity(data)
