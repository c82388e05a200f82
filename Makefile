# Every target does its own set-up on a bare machine: python3 (3.11 or later), a C compiler and cargo are enough.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Folders, with a colon between them in the variable; what compares with stored figures reads the first one.
SCENARIOS := $(subst :, ,$(or $(INTERDRIVE_SCENARIOS),../shared/scenarios))
STORED := $(firstword $(SCENARIOS))
COMPARED := --planner frenet,frenetix,reactive,idm_mobil --predictor lane_following
RUST := Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -o -name Cargo.toml)
export PYTHONWARNINGS ?=
export UV_SYSTEM_CERTS ?= 1
export MPLBACKEND := Agg
# Tests start hundreds of processes, and without stored bytecode each compiles all that it imports, for seconds.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test long recorded check bench performance cooperation driving driving_side_by_side driving_guard instructions audit oracles third_party planners ray sumo browser learning learn train report_bundle environments versions docs wheel wheels container locks help fuzz fuzz-smoke fuzz-core mutants format clean

# Environments: .tools installs what WANTED names (p is the project's table, o are its extras), .installed adds interdrive.
ENVIRONMENTS := $(VENV) .venv-docs .venv-release .venv-oracles .venv-oldest .venv-third .venv-ray .venv-sumo .venv-browser .venv-rl .venv-training
$(VENV)/.tools: WANTED = p['dependencies'] + o['dev']
.venv-docs/.tools: WANTED = p['dependencies'] + o['docs']
.venv-release/.tools: WANTED = o['release']
.venv-oracles/.tools: WANTED = p['dependencies'] + o['oracles'] + o['checker']
# These packages have requirements without wheels; the parts that are called here do not need them.
.venv-oracles/.tools: ALONE = commonroad-crime==0.4.5
# Of every dependency exactly the lower bound.
.venv-oldest/.tools: WANTED = [re.sub(r'>=([^,]+).*', r'==\1', one) for one in p['dependencies']] + ['pytest>=8']
# Their planners need older versions of what interdrive uses (commonroad-io 2024.3), and Python before 3.12.
.venv-third/.tools: WANTED = p['dependencies'] + o['frenetix'] + o['reactive'] + o['fiss'] + ['pytest>=8']
# Ray and commonroad-io agree on protobuf 3.20.2, which holds Ray back; no other environment should be held back with it.
.venv-ray/.tools: WANTED = p['dependencies'] + o['ray'] + ['pytest>=8']
.venv-sumo/.tools: WANTED = p['dependencies'] + o['sumo'] + ['pytest>=8']
.venv-browser/.tools: WANTED = ['playwright>=1.49', 'pillow>=10', 'pytest>=8']
.venv-training/.tools: WANTED = p['dependencies'] + o['training']
.venv-rl/.tools: WANTED = p['dependencies'] + o['rl'] + o['learning']
# The index of torch without CUDA keeps the download small.
.venv-rl/.tools .venv-training/.tools: INDEX = --extra-index-url https://download.pytorch.org/whl/cpu --index-strategy unsafe-best-match

# Versions that were tested together, so that a checkout can be built in a year; `make locks` takes the newest ones.
# Python before 3.11 or after 3.13 may need others: LOCKED= leaves them out.
LOCKED = $(addprefix -c ,$(wildcard locks/$(patsubst .%,%,$(@D)).txt))

# uv installs in a fifth of pip's time, and each package is downloaded once for all environments.
.uv/bin/uv:
	$(PYTHON) -m venv .uv
	.uv/bin/python -m pip install --quiet --disable-pip-version-check uv

$(ENVIRONMENTS:%=%/.tools): pyproject.toml .uv/bin/uv $(wildcard locks/*.txt)
	.uv/bin/uv venv --quiet --seed --clear --python $(PYTHON) $(@D)
	$(@D)/bin/python -c "import re, tomllib; p = tomllib.load(open('pyproject.toml', 'rb'))['project']; o = p['optional-dependencies']; print(*$(WANTED), sep='\n')" > $(@D)/requirements.txt
	.uv/bin/uv pip install --quiet --python $(@D)/bin/python $(INDEX) $(LOCKED) -r $(@D)/requirements.txt
	$(if $(ALONE),.uv/bin/uv pip install --quiet --python $(@D)/bin/python --no-deps $(ALONE))
	touch $@

# Tests use the profile `quick`, which builds in half the time and computes the same bits; times are measured on release.
$(VENV)/.installed: $(VENV)/.tools $(RUST)
	rm -f $(VENV)/.optimised
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --profile quick --quiet
	touch $@

$(VENV)/.optimised: $(VENV)/.tools $(RUST)
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release --quiet
	touch $(VENV)/.installed $@

# The compiled core is the same for every version of Python and lies beside the sources, so the others point to it.
.venv-%/.installed: .venv-%/.tools $(VENV)/.installed
	cp -r $(VENV)/lib/python3*/site-packages/interdrive* .venv-$*/lib/python3*/site-packages/
	touch $@

# Needs apt-get and root only where there is no Chromium yet; without one the tests say so.
CHROMIUM = command -v chromium || command -v chromium-browser || command -v google-chrome
.venv-browser/.chromium: .venv-browser/.tools
	$(CHROMIUM) || timeout 300 sh -c \
	  "apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium" > /dev/null 2>&1 || echo "no Chromium"
	if $(CHROMIUM) > /dev/null; then touch $@; fi

demo: $(VENV)/.installed ## the T-junction: every car plans for itself
	$(BIN)/interdrive run t_junction --agents all --out demo --overwrite --png --gif --report
	@echo "open $(CURDIR)/demo/report.html in a browser; the film is $(CURDIR)/demo/run.gif, the picture $(CURDIR)/demo/run.png"

test: $(VENV)/.installed ## tests of the core and the package, but those of `make long` and `make recorded`
	cargo test --profile quick --quiet -p interdrive-core -p interdrive-commonroad
	$(BIN)/python -m pytest -q -n 2 --dist worksteal --durations=60 -m "not recorded and not long" # a module's fixtures are made by one worker

long: $(VENV)/.installed ## tests that take seconds: batches, whole commands, examples, faults of disks and processes
	$(BIN)/python -m pytest -q -n 2 --dist worksteal --durations=40 -m "long and not recorded"

# One process, which reads the files once.
recorded: $(VENV)/.installed ## tests that read every recorded scenario
	$(BIN)/python -m pytest -q --durations=8 -m recorded

check: $(VENV)/.installed ## formatters, linters, types, stubs, layers
	cargo fmt --all --check
	cargo clippy --profile quick --all-targets --quiet -- -D warnings
	cargo test --profile quick --quiet -p interdrive-core --test layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest interdrive._core
	$(BIN)/lint-imports
	$(BIN)/python scenarios/make.py --check
	$(BIN)/python crates/python/settings.py --check
	$(BIN)/python crates/python/observation.py --check
	$(BIN)/python benchmarks/populations.py --check
	$(BIN)/python frontend/contract.py --check
	$(BIN)/python releases/licences.py --check

# Runs the tutorials, which makes their pictures. Needs no network once the environment is there.
docs: .venv-docs/.installed ## the site in out/site: tutorials are run, references generated, links checked; warnings fail
	.venv-docs/bin/python -m sphinx -q -W --keep-going -b html -d out/doctrees docs out/site
	.venv-docs/bin/python docs/extensions/links.py out/site README.md ARCHITECTURE.md CONTRIBUTING.md RELEASES.md
	.venv-docs/bin/python docs/extensions/ages.py

wheel: .venv-release/.tools ## a wheel for this machine in dist/ (some minutes)
	.venv-release/bin/python -m maturin build --release --out dist --quiet
	@ls -1 dist/*_$$(uname -m).whl

wheels: .venv-release/.tools ## wheels for x86_64 and aarch64 and an sdist in dist/, tried in fresh environments; see RELEASES.md
	.venv-release/bin/python releases/wheels.py

container: ## builds the image of the Dockerfile with the wheel in dist/ and drives in it; without docker in an empty root
	$(PYTHON) releases/container.py

LOCKS := venv venv-docs venv-oracles venv-third venv-ray venv-sumo
locks: ## the newest versions that fit, in fresh environments, written to locks/
	rm -rf $(LOCKS:%=.%)
	$(MAKE) LOCKED= $(LOCKS:%=.%/.tools)
	for name in $(LOCKS); do .uv/bin/uv pip freeze --quiet --python .$$name/bin/python > locks/$$name.txt; done

help: ## lists all targets
	@sed -n 's/^\([a-z_-]*\):.*## \(.*\)/\1\t\2/p' $(MAKEFILE_LIST) | expand -t 24

bench: $(VENV)/.optimised ## time per step, phases, memory, start; time for all criticality measures; targets
	$(BIN)/python benchmarks/table.py
	$(BIN)/python benchmarks/start.py
	if [ -e .venv-third/.installed ]; then .venv-third/bin/python benchmarks/against_frenetix.py --times-only; fi
	$(BIN)/python benchmarks/criticality.py
	$(BIN)/python benchmarks/environments.py $(STORED)
	$(BIN)/python benchmarks/cooperation.py
	$(BIN)/python benchmarks/targets.py

# On a quiet machine, about half an hour; PEER is a checkout of TUM-AVS/Frenetix-Motion-Planner 2024.4 (left out without).
performance: $(VENV)/.optimised .venv-third/.installed ## measures all of docs/research/performance.md, and the environments of learning.md, and writes them
	mkdir -p out
	$(BIN)/interdrive study runtime --out out/study_runtime --overwrite
	$(BIN)/python benchmarks/start.py > out/start.md
	$(BIN)/python benchmarks/commands.py $(STORED) > out/commands.md
	$(BIN)/python benchmarks/environments.py $(STORED) > out/environments.md
	$(BIN)/python benchmarks/floors.py > out/floors.md
	.venv-third/bin/python benchmarks/against_frenetix.py --times-only > out/frenetix.md
	$(BIN)/python benchmarks/peers/rule_based.py > out/rule_based.md
	if [ -n "$(PEER)" ]; then $(BIN)/python benchmarks/peers/handler.py $(PEER) > out/handler.md; fi
	$(BIN)/python benchmarks/targets.py out/study_runtime --memory --document

cooperation: $(VENV)/.optimised ## the study of docs/research/cooperation.md in out/study_cooperation: tables and figure, a quarter of an hour
	$(BIN)/interdrive study cooperation --seeds 3 --out out/study_cooperation --overwrite

driving: $(VENV)/.optimised ## how well agents drive in all scenarios: in time, collisions, causes, realism; see docs/research/driving.md
	$(BIN)/python benchmarks/driving $(STORED)

driving_side_by_side: $(VENV)/.optimised ## the same agents with other predictors and among traffic that interacts less: a quarter of an hour
	$(BIN)/python benchmarks/driving/side_by_side.py $(STORED)

driving_guard: $(VENV)/.installed ## do agents still drive as well as stored? benchmarks/driving/guard.py --update stores new figures
	$(BIN)/python benchmarks/driving/guard.py $(STORED)

instructions: $(VENV)/.installed ## instructions of the hot paths against stored figures; benchmarks/instructions.py --update stores them
	$(BIN)/python benchmarks/instructions.py

# Weaknesses that became known come from the internet (the advisory databases of RustSec and PyPI), so CI does not ask.
# With --strict a package that could not be looked up is a failure, too.
audit: .uv/bin/uv ## known weaknesses, licences and sources of all dependencies; builds cargo-deny if it is missing (minutes)
	cargo deny --version > /dev/null 2>&1 || cargo install cargo-deny --locked
	cargo deny check
	for name in locks/*.txt; do .uv/bin/uv tool run pip-audit --strict --disable-pip --no-deps -r $$name || exit 1; done

mutants: ## breaks formulas, contacts, outcomes and limits on purpose, and lists what no unit test notices
	cargo mutants --version > /dev/null 2>&1 || cargo install cargo-mutants --locked
	$(PYTHON) benchmarks/mutants.py

oracles: .venv-oracles/.installed ## compares geometry and planner with other libraries; see docs/research/oracles.md
	.venv-oracles/bin/python -m pytest -q --durations=12 -n auto --dist loadfile tests/oracles

environments: $(patsubst %,%/.installed,$(filter-out .venv-browser .venv-rl .venv-training .venv-release,$(ENVIRONMENTS))) .venv-browser/.chromium ## all environments that CI needs

# Regressions first, then mutants until the time is over; what fails is kept in out/fuzz. FUZZ_SEED tells campaigns apart.
FUZZ_SEED ?= 1
FUZZ_SECONDS ?= 3600
fuzz: $(VENV)/.installed ## mutated files through everything; see docs/research/robustness.md
	$(BIN)/python -m tests.fuzz --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED) --seeds $(wildcard $(SCENARIOS:%=%/format_edge_cases) $(STORED)/../robustness)

fuzz-smoke: $(VENV)/.installed ## regressions, 300 mutants and 400 of other formats, the same ones every time, for two minutes at most
	$(BIN)/python -m tests.fuzz --seconds 60 --mutants 300
	$(BIN)/python -m tests.fuzz --seconds 60 --mutants 400 --formats all

# Needs a nightly Rust. What is found lies in fuzz/artifacts.
FUZZ_MINUTES ?= 5
fuzz-core: ## new paths through the core, FUZZ_MINUTES for each target; see fuzz/README.md
	cargo fuzz --version > /dev/null 2>&1 || cargo install --quiet --locked cargo-fuzz
	for target in road_network curves drives criticality; do cargo +nightly fuzz run --sanitizer none $$target -- \
	  -max_total_time=$$((60 * $(FUZZ_MINUTES))) -timeout=25 -rss_limit_mb=2048 -malloc_limit_mb=512 -max_len=2000 \
	  -len_control=0 || exit 1; done

third_party: .venv-third/.installed ## tests of third-party planners; see docs/reference/planners_third_party.md
	.venv-third/bin/python -m pytest -q --durations=8 tests/third_party

# Hours; can be interrupted and called again. Exit code 1 says that some runs failed, which the comparison counts.
planners: .venv-third/.installed ## compares four planners on all recorded scenarios, interactive and one by one; see docs/research/planners.md
	-.venv-third/bin/python -m interdrive batch $(SCENARIOS) $(COMPARED) --run-timeout 7200 --out out/planners
	-.venv-third/bin/python -m interdrive batch $(SCENARIOS) $(COMPARED) --run-timeout 7200 --out out/planners --alone --traffic recorded
	.venv-third/bin/python -m interdrive compare out/planners

ray: .venv-ray/.installed ## batches on a local Ray cluster of two nodes; see docs/how_to/ray.md
	.venv-ray/bin/python -m pytest -q --durations=8 tests/cluster

sumo: .venv-sumo/.installed ## traffic by SUMO, in an environment that has it; see docs/how_to/sumo.md
	.venv-sumo/bin/python -m pytest -q --durations=8 tests/sumo

browser: $(VENV)/.installed .venv-browser/.chromium .venv-docs/.tools ## opens reports in Chromium; skipped where there is none, which is a failure in CI
	.venv-browser/bin/python -m pytest -q -s --confcutdir=tests/browser tests/browser

report_bundle: ## builds the front end of reports (needs node and npm); says whether what is committed was current
	cd frontend && npm ci --no-audit --no-fund --silent && npm run --silent check && npm run --silent build
	git diff --exit-code --stat -- python/interdrive/report/bundle

versions: .venv-oldest/.installed ## drives, saves, reads, judges and draws with the oldest libraries that pyproject.toml allows
	.venv-oldest/bin/python -m pytest -q -W ignore::DeprecationWarning tests/project/test_versions.py

# Not a part of CI: torch with CUDA, the only one that its machines can get, has 3 GB.
learning: .venv-rl/.installed ## tests of environments in Stable-Baselines3: its checker, its algorithm
	.venv-rl/bin/python -m pytest -q --durations=8 tests/learning

learn: $(VENV)/.optimised ## trains the policy of docs/research/learning.md, for up to 10 minutes on two cores
	$(BIN)/python scenarios/varied.py out/varied --number 40
	$(BIN)/python scenarios/varied.py out/unseen --number 12 --seed 10000
	OPENBLAS_NUM_THREADS=1 $(BIN)/python examples/rl/ppo.py --out out/ppo --scenarios out/varied
	$(BIN)/python examples/rl/compare.py out/ppo/policy.safetensors --unseen $(STORED) --yielding out/unseen

train: .venv-training/.installed ## makes the weights of the neural predictor anew; see training/README.md
	.venv-training/bin/python -m training

format: $(VENV)/.tools ## writes what `make check` wants to see
	cargo fmt --all
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(ENVIRONMENTS) .uv frontend/node_modules target demo out dist docs/reference/generated docs/tutorials/pictures
