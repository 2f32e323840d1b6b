VENV ?= .venv
BIN = $(VENV)/bin
export VENV

.PHONY: demo test test-all campaign mutate format clean

demo:
	@scripts/environment analysis
	@$(BIN)/workbench demo --out out/demo

test:
	@scripts/environment dev
	@PATH="$(abspath $(BIN)):$$PATH" scripts/check

test-all:
	@scripts/environment dev
	@PATH="$(abspath $(BIN)):$$PATH" scripts/check -m "" --forbid-skips

campaign:
	@scripts/environment dev
	@$(BIN)/python -m pytest -m campaign

mutate:
	@scripts/environment dev
	@$(BIN)/python scripts/mutate.py $(MUTATE)

format:
	@scripts/environment dev
	@$(BIN)/ruff check --fix --quiet .
	@$(BIN)/ruff format --quiet .

clean:
	rm -rf $(VENV) out build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
