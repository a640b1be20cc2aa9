# Every developer command. CI calls the same ones.

CARGO ?= cargo
PYTHON ?= python3
PEERS := benches/.venv/bin/python

.PHONY: help demo test soak lint doc bench audit clean

help: ## list these commands
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 10

demo: ## encode and decode the built-in capture; results in cager-demo/
	$(CARGO) run --release --locked --quiet --bin cager -- demo

test: ## run every test
	@$(CARGO) test --workspace --locked --doc --quiet
	@if $(CARGO) nextest --version >/dev/null 2>&1; then \
		$(CARGO) nextest run --workspace --locked; \
	else \
		$(CARGO) test --workspace --locked --lib --bins --tests; \
	fi

soak: ## kill the service a hundred times under load; KILLS and SEED change how often and when
	CAGER_SOAK_KILLS=$(or $(KILLS),100) $(if $(SEED),CAGER_SOAK_SEED=$(SEED)) \
		$(CARGO) test --release --locked --test reliability -- --exact --nocapture soak::a_service_that_is_killed_keeps_what_it_said

lint: ## formatting, clippy and documentation, all warnings denied
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps --locked

doc: ## build the API documentation
	$(CARGO) doc --workspace --no-deps --locked

bench: $(PEERS) ## measure the figures beside their peers: benches/results.json and the README's table
	$(CARGO) build --release --locked --bin cager
	$(PYTHON) benches/run.py

$(PEERS): benches/peers/requirements.txt
	$(PYTHON) -m venv benches/.venv
	benches/.venv/bin/pip install --quiet --requirement benches/peers/requirements.txt
	@touch $@

audit: ## licences and advisories of all dependencies; needs cargo-deny and the network
	$(CARGO) deny check

clean: ## remove everything that was built
	$(CARGO) clean
	rm -rf benches/.venv cager-demo
