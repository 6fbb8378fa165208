# What a user needs is installed by the target that needs it (Debian packages, with apt-get). Rust itself is expected.

CARGO ?= cargo
PREFIX ?= /usr/local
DESTDIR ?=

# What `make render` renders.
SCENE ?= scenes/gallery/gallery.glb
SIZE ?= 1280x720
SPP ?= 16

TWINCAST = target/release/twincast

.PHONY: help render test check stress stress-long test-embree4 install packages build

help: ## list these targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "  make %-14s %s\n", $$1, $$2 }' Makefile

packages:
	@scripts/install-packages.sh

build: packages
	$(CARGO) build --locked --release

render: build ## render the README's scene to out/gallery.exr and out/gallery.png
	@mkdir -p out
	$(TWINCAST) render $(SCENE) -o out/gallery.exr -o out/gallery.png --size $(SIZE) --spp $(SPP)
	@echo "rendered $(SCENE) at $(SIZE), $(SPP) samples a pixel: out/gallery.exr (linear) and out/gallery.png (sRGB)"

test: packages ## run the tests of library and program
	$(CARGO) test --locked

# The longest tests of the native tracer alone and of how samples are spread, which are the same on every system: `make test` has run them.
NATIVE = brute_force:: stress::native stress::mutants accelerators:: render::adaptive:: documents::of_growth
# Those that no feature changes, either, but for what Embree itself does.
FEATURELESS = $(NATIVE) stress::the_matrix render::determinism:: render::transport::
# What no library of the system changes, besides: how files are read, and that a render goes on where it was killed.
SYSTEMLESS = $(NATIVE) mutation:: resume::a_render
# With the Python package, so that one library serves both: who depends on a crate decides on its features.
WITHOUT_FEATURES = --no-default-features -p twincast -p twincast-python

check: packages ## formatting, lints, documentation, and the program once more without default features
	$(CARGO) fmt --all --check
	$(CARGO) clippy --locked --all-targets -- -D warnings
	$(CARGO) clippy --locked $(WITHOUT_FEATURES) -p twincast-rtc --features twincast-rtc/v3 --all-targets -- -D warnings
	$(CARGO) clippy --locked $(WITHOUT_FEATURES) -p twincast-rtc --features twincast-rtc/v4 --all-targets -- -D warnings
	RUSTDOCFLAGS='-D warnings' $(CARGO) doc --locked --no-deps
	$(CARGO) test --locked $(WITHOUT_FEATURES) --test twincast -- $(addprefix --skip ,$(FEATURELESS))
	$(CARGO) test --locked $(WITHOUT_FEATURES) --doc

stress: build ## every method on the cases on which ray casters fail: out/stress/matrix.svg
	@mkdir -p out/stress
	$(TWINCAST) stress -o out/stress
	$(TWINCAST) stress --search 20 -o out/stress

stress-long: build ## a hundred million random rays and ten million difficult ones on the native tracer, and an hour of looking for more
	@mkdir -p out/stress
	for seed in $$(seq 25); do \
	    $(TWINCAST) stress --method native --in-turns --case soups --rays 4000000 --seed $$seed || exit; \
	done
	$(TWINCAST) stress --method native --in-turns --rays 400000 --seed 1 -o out/stress
	$(TWINCAST) stress --search 3600 --seed 1 -o out/stress

test-embree4: ## run the tests on Debian 13, with its Embree 4 and OpenImageIO 2.5; scripts/test-embree4.sh runs every one
	@scripts/test-embree4.sh -- $(addprefix --skip ,$(SYSTEMLESS))

install: build ## put binary, man pages and completions under PREFIX (/usr/local); honours DESTDIR
	install -Dm755 $(TWINCAST) '$(DESTDIR)$(PREFIX)/bin/twincast'
	install -d '$(DESTDIR)$(PREFIX)/share/man/man1' \
	    '$(DESTDIR)$(PREFIX)/share/bash-completion/completions' \
	    '$(DESTDIR)$(PREFIX)/share/zsh/site-functions' \
	    '$(DESTDIR)$(PREFIX)/share/fish/vendor_completions.d'
	$(TWINCAST) man --out '$(DESTDIR)$(PREFIX)/share/man/man1'
	$(TWINCAST) completions bash > '$(DESTDIR)$(PREFIX)/share/bash-completion/completions/twincast'
	$(TWINCAST) completions zsh > '$(DESTDIR)$(PREFIX)/share/zsh/site-functions/_twincast'
	$(TWINCAST) completions fish > '$(DESTDIR)$(PREFIX)/share/fish/vendor_completions.d/twincast.fish'

.PHONY: wheel test-python bench-python
wheel: ## the Python package as a wheel for any Linux (manylinux_2_28), in target/wheels
	@scripts/wheel.sh

test-python: ## build the Python package and run its tests; OPEN3D=1 compares with Open3D as well
	@scripts/test-python.sh

bench-python: ## the Python package against embreex, trimesh and, where it is installed, Open3D; after test-python
	@target/python/bin/python ffi/python/bench.py

.PHONY: bench-fair
bench-fair: build ## whether Twincast gets out of Embree what a plain C++ client does: at least 95 %
	@scripts/bench-fair.sh

.PHONY: dropin test-dropin verify-dropin
dropin: ## build libembree3.so.3 and libembree4.so.4 over the native tracer, in target/dropin
	@CARGO='$(CARGO)' scripts/build-dropin.sh

test-dropin: packages dropin ## tests of the C interface, on Embree and on our library
	@scripts/test-dropin.sh

verify-dropin: test-dropin ## Embree's own tests on our library, beside what Embree scores
	@scripts/install-packages.sh embree-tools
	@scripts/verify-dropin.sh

.PHONY: pictures-dropin soak-dropin
pictures-dropin: dropin ## pictures of Embree's example programs, on Embree and on our library
	@scripts/install-packages.sh embree-tools
	@scripts/pictures-dropin.py

soak-dropin: test-dropin ## a million scenes on our library, and its tests under valgrind
	@scripts/install-packages.sh valgrind
	@scripts/soak-dropin.sh
