# `make demo`, `make run` and `make test` are all a newcomer needs; tools/bootstrap.sh does the work.
.PHONY: run demo test slow lint bench faults soak sbom fuzz docs install clean

run:
	@sh tools/bootstrap.sh run $(ARGS)

# a simulated robot, a hidden change, the verdict in the browser: two minutes; ARGS="--seed 2" for another change
demo:
	@sh tools/bootstrap.sh demo $(ARGS)

test:
	@sh tools/bootstrap.sh test $(ARGS)

# the slow tests of what has changed, which `make test` runs too; ARGS="--slow all" for all of them
slow:
	@sh tools/bootstrap.sh slow $(ARGS)

lint:
	@sh tools/bootstrap.sh lint

bench:
	@sh tools/bootstrap.sh bench $(ARGS)

# real processes under real faults; ARGS="--short" takes a minute
faults:
	@sh tools/bootstrap.sh faults $(ARGS)

# hours; ARGS="--minutes 30" for less
soak:
	@sh tools/bootstrap.sh soak $(ARGS)

sbom:
	@sh tools/bootstrap.sh sbom $(EXTRA)

fuzz:
	@sh tools/bootstrap.sh install dev
	@$${ACQD_VENV:-.venv}/bin/python -m tools.studies.fuzz $(ARGS)

# the site in site/, and man pages in site/man
docs:
	@sh tools/bootstrap.sh install docs
	@$${ACQD_VENV:-.venv}/bin/python -m tools.docs $(ARGS)

install:
	@sh tools/bootstrap.sh install $(EXTRA)

clean:
	rm -rf .venv .mypy_cache .ruff_cache .hypothesis *.egg-info
