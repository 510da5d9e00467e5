# `make run` and `make test` are all a newcomer needs; tools/bootstrap.sh does the work.
.PHONY: run test lint bench faults install clean

run:
	@sh tools/bootstrap.sh run $(ARGS)

test:
	@sh tools/bootstrap.sh test $(ARGS)

lint:
	@sh tools/bootstrap.sh lint

bench:
	@sh tools/bootstrap.sh bench $(ARGS)

# real processes under real faults; ARGS="--short" takes a minute
faults:
	@sh tools/bootstrap.sh faults $(ARGS)

install:
	@sh tools/bootstrap.sh install $(EXTRA)

clean:
	rm -rf .venv .mypy_cache .ruff_cache .hypothesis *.egg-info
