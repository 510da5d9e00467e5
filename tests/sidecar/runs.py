"""The sidecar as a process, and what it stored."""

import json

from acqd.sidecar.store import Store
from acqd.storage.database import open_database
from tests.commands import acqd_here


def sidecar(logs, bundle, url, *more):
    """What follows `acqd` on the command line."""
    return ["sidecar", str(logs), "--model", str(bundle), "--database", url, "--device", "cell", *more]


def run(words):
    return acqd_here(*words)


def counts_of(result):
    """The last line; before it comes one for each log."""
    *logs, counts = map(json.loads, result.stdout.splitlines())
    assert len(logs) == counts["done"] + counts["refused"] and all(each["status"] in ("ok", "refused") for each in logs)
    return counts


def done_in(url):
    store = Store(open_database(url))
    with store.engine.connect() as connection:
        rows = connection.exec_driver_sql("SELECT name, status, message FROM prediction_log ORDER BY name").all()
        counts = dict(
            connection.exec_driver_sql(
                "SELECT name, count(*) FROM prediction JOIN prediction_log USING (sha256) GROUP BY name"
            ).all()
        )
    return {
        name: (status, message if isinstance(message, dict) else json.loads(message)) for name, status, message in rows
    }, counts
