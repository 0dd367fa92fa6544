# make setup, once; make check, before every commit (90 s on two cores); make test, before a push.
.PHONY: setup check test docs house

setup:
	python -m pip install -e ".[dev]" pre-commit
	pre-commit install

check:
	ruff check .
	ruff format --check .
	mypy
	pytest -n auto -m "not slow" tests/test_*.py tests/fe tests/building tests/dynamics tests/effects

test:
	pytest -n auto

docs:
	mkdocs build --strict

house:
	python tests/house.py
