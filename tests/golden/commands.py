"""The commands that the net runs, and why it does not run the others.

`{o}` is the place of this command's results, the other names in braces are inputs of `corpus`.
Each command runs twice: with --json, when the files that it writes are compared as well, and
without it.
"""

from tests.golden.foreign import FOREIGN

ON_BENCH = {
    "press": "press {rig} --sim --seed 1 -n 2 --out {o} --log {o}/log.txt",
    "press two": "press {rig} --scene two-choirs --seed 5 -n 2 --out {o} --log {o}/log.txt",
    "learn": "learn {rig} --sim --seed 1 -n 2 --out {o} --log {o}/log.txt",
    "setup touch": "setup {rig} touch --scene {mute} --seed 1 --yes --log {o}/log.txt",
    "setup home": "setup {rig} home --scene {mute} --seed 1 --yes --log {o}/log.txt",
    "setup contact": "setup {rig} contact --scene {mute} --seed 1 --yes --log {o}/log.txt",
    "replay": "replay {press}/press-0001.mcap {rig} --scene ideal --seed 2 --out {o}"
    " --log {o}/log.txt",
    "acquire": 'acquire {rig} --sim --seed 3 --duration "0.2 s" --out {o}.mcap',
    "acquire dry": "acquire {rig} --sim --dry-run",
}
"""Commands that move the stand-in, or connect to it."""
AT_DESK = {
    "init": "init {o}.toml",
    "plan": "plan paper --verbose --out {o}.json",
    "mount": "mount paper",
    "predict": "predict paper",
    "predict beam": "predict paper --level beam",
    "phases": "phases {presses} --verbose",
    "phases old": "phases {old}",
    "phases two": "phases {press_two} --verbose",
    "phases by hand": 'phases {others}/press-0004.mcap --at "52.1 ms +- 0.3 ms to 72.05 ms +- 0.05'
    ' ms"',
    "compare": "compare {presses}",
    "compare two": "compare {press_two}",
    "compare against": "compare {presses} --against {old}",
    "identify": "identify {presses} --free plectrum.overlap,key.inertia --out {o}.toml",
    "identify two": "identify {press_two} --free plectrum.overlap --robust",
    "transient": "transient {press_two}",
    "animate": 'animate {presses}/press-0001.mcap --since "70 ms" --until "70.5 ms" --slow 200'
    " --out {o}.gif",
    "listen": 'listen paper --duration "0.1 s" --out {o}.wav',
    "campaign": "campaign {presses} --processes 1 --out {o}.parquet",
    "touch": "touch {old_table}",
    "survey": "survey {keys}",
    "watch": "watch {old} -n 2",
    "report": "report {press_two} --out {o}.html",
    "report old": "report {old} --out {o}.html",
    "info": "info {presses}/press-0001.mcap",
    "info old": "info {old}/press-0001.mcap",
    "info format 1": "info {format_1}",
    "info cut": "info {cut}",
    "recover": "recover {cut} --out {o}.mcap",
    "split": "split {long} --out {o}",
    **{
        f"export {kind}": f"export {{presses}}/press-0001.mcap --to {kind} --out {{o}}.{kind}"
        for kind in ("csv", "parquet", "h5", "wav", "tdms", "urdf")
    },
    "export raw": "export {press}/press-0001.mcap --to parquet --raw --out {o}.parquet",
    **{
        f"import {kind}": f"import {{foreign_{kind}}} --out {{o}}.mcap {options}"
        for kind, (_, options) in FOREIGN.items()
    },
    "import refused": "import {foreign_csv} --out {o}.mcap --rig paper",
    "trade": "trade paper --scene pluck --fresh",
}
COMMANDS = ON_BENCH | AT_DESK
VARIABLE = (
    "real_time_factor", "build_time", "run_time", "spread", "compile_time", "machine",
    "pareto", "recommended",
    "size", "sha256", "samples_sha256", "software",
)  # fmt: skip
"""Keys of answers that measure the machine, or depend on the versions that a recording names."""
WITHOUT_TEXT = {"trade": "its table lists times of this machine"}
UNCOVERED = {
    "outline": "its photographs are drawn by tests/analysis/test_outline_photo.py",
    "voice": "its elements take a minute; tests/analysis/test_voice.py",
    "effects": "its presses are of a design; tests/analysis/test_effects.py",
    "package": "its bytes depend on the code; tests/bench/test_package.py",
    "doctor": "it describes this machine and its packages",
    "stand-in": "it serves until it is interrupted; `press` and `setup` use the same bench",
    "--install-completion": "it changes the user's shell; cyclopts writes it",
    "--help": "cyclopts writes it from the options, which the group `interface` holds",
    "-h": "the same",
    "--help-all": "the same",
    "--version": "it prints the version",
}
"""Commands that no case runs, and why."""
