# Needs Python >= 3.11 and Rust; everything else is set up in .venv.

PYTHON ?= python3
BIN := .venv/bin
ENVIRONMENT := .venv/.environment
TOOLS := .venv/.tools
SPHINX := .venv/.sphinx
MUTMUT := target/mutmut
EXTENSION := python/alsph/_alsph.abi3.so
SOURCES := Cargo.toml Cargo.lock pyproject.toml $(shell find rust -name '*.rs')
export PYO3_PYTHON := $(CURDIR)/$(BIN)/python

.PHONY: build run wheel test programs test-rust test-python test-validation validate docs links bench clean mutants-python

build: $(EXTENSION)

run: $(EXTENSION)  ## The cylinder at a coarse resolution, in about three minutes on two cores.
	$(BIN)/alsph run cylinder --resolution 10 --until 20 --output runs/cylinder --force
	$(BIN)/alsph plot runs/cylinder

test: programs test-rust test-python test-validation

programs: $(TOOLS)  ## The extension beside the engine's tests, since each leaves a core idle for minutes.
	$(MAKE) $(EXTENSION) & building=$$!; cargo test --no-run; tested=$$?; wait $$building && exit $$tested

test-rust: $(TOOLS)
	cargo fmt --check
	cargo clippy --all-targets -- -D warnings
	cargo clippy --features python -- -D warnings
	cargo test

test-python: $(EXTENSION) $(TOOLS)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/pytest --numprocesses auto --dist loadfile

test-validation: $(EXTENSION)  ## The quick validation from scratch.
	rm -rf target/validation
	$(BIN)/alsph validate --quick --output target/validation

validate: $(EXTENSION)  ## Cases beside their reference solutions, in minutes on two cores.
	$(BIN)/alsph validate

docs: $(EXTENSION) $(SPHINX)  ## The documentation site, in target/docs; a warning is an error.
	rm -rf docs/generated
	$(BIN)/python -m sphinx --fresh-env --fail-on-warning --keep-going -b html docs target/docs
	RUSTDOCFLAGS="--deny warnings --allow rustdoc::private_intra_doc_links" cargo doc --no-deps --quiet
	rm -rf target/docs/rust && cp -r target/doc target/docs/rust

links: $(EXTENSION) $(SPHINX)  ## Whether the pages of other sites that the documentation links to are there.
	$(BIN)/python -m sphinx -D nb_execution_mode=off -b linkcheck docs target/links

wheel: $(ENVIRONMENT)  ## A wheel for every Linux of this machine's kind with glibc 2.28 or later, in target/wheels.
	$(BIN)/python -m pip install --quiet --group wheel
	PATH="$(CURDIR)/$(BIN):$$PATH" maturin build --release --zig --compatibility manylinux_2_28  # which finds zig there

bench:
	cargo bench

mutants-python: $(EXTENSION) $(TOOLS) $(MUTMUT)  ## Faults put into the Python code one at a time, an hour or more.
	$(MUTMUT)/bin/python benches/mutants.py $(MUTANTS)

$(MUTMUT):  ## An environment of its own that sees the packages of .venv.
	$(BIN)/python -m venv $@
	$(BIN)/python -c "import sysconfig; print(sysconfig.get_path('purelib'))" > \
	    $$($@/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/alsph-packages.pth
	$@/bin/python -m pip install --quiet mutmut==3.8.1

clean:
	cargo clean
	rm -rf .venv $(EXTENSION) .pytest_cache .mypy_cache .ruff_cache .hypothesis

# What a run needs to be built; what a run needs itself comes with the extension.
$(ENVIRONMENT): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "alsph needs Python 3.11 or later; set PYTHON=...")'
	@command -v cargo >/dev/null || { echo "alsph needs Rust: https://rustup.rs"; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --group build
	touch $@

$(TOOLS): $(ENVIRONMENT)
	$(BIN)/python -m pip install --quiet --group test
	touch $@

$(SPHINX): $(ENVIRONMENT)
	$(BIN)/python -m pip install --quiet --group docs
	touch $@

$(EXTENSION): $(ENVIRONMENT) $(SOURCES)
	$(BIN)/maturin develop --release
	touch $@
