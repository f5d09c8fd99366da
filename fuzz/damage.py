"""Damages recordings at random and runs the program on each: it may refuse, report and skip, but never crash or hang.

    cargo build --release --no-default-features
    python3 fuzz/damage.py --rounds 1000 --seed 1

Each round copies one of the bundled recordings, damages one to four places (flipped bits, zeros, noise, cuts, repeated
or swapped pieces, a changed length), and runs `info`, `replay` and `recover`. Allowed are the exit codes 0, 1 and 3 and
the stated memory. The same seed makes the same damage. Prints one JSON object; a failing recording is kept.
"""

import argparse
import json
import os
import pathlib
import random
import resource
import shutil
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).parent.parent


def damage(data, chance):
    """Damages one place; returns what was done."""
    size = len(data)
    at = chance.randrange(size)
    # Half of all damage is to the start and the end, where headers and indexes are.
    if chance.random() < 0.5:
        at = chance.choice([at % min(size, 512), size - 1 - at % min(size, 4096)])
    length = min(size - at, 1 << chance.randrange(16))
    kind = chance.choice(["flip", "zero", "noise", "cut", "remove", "repeat", "swap", "number"])
    piece = bytes(data[at:at + length])
    if kind == "flip":
        data[at] ^= 1 << chance.randrange(8)
    elif kind == "zero":
        data[at:at + length] = bytes(length)
    elif kind == "noise":
        data[at:at + length] = chance.randbytes(length)
    elif kind == "cut":
        del data[at:]
    elif kind == "remove":
        del data[at:at + length]
    elif kind == "repeat":
        data[at:at] = piece
    elif kind == "swap":
        other = chance.randrange(size)
        data[at:at + length], data[other:other + length] = data[other:other + length], piece
    else:
        width = chance.choice([4, 8])
        number = chance.choice([0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1, chance.getrandbits(64)])
        data[at:at + width] = (number % 2**(8 * width)).to_bytes(width, "little")
    return kind


def run(command, seconds):
    """Exit code, seconds and peak memory in MB; the code is None after the deadline."""
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while True:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode, time.monotonic() - start, usage.ru_maxrss / 1024
        if time.monotonic() - start > seconds:
            process.kill()
            os.wait4(process.pid, 0)
            return None, seconds, 0
        time.sleep(0.002)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    target = os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target"))
    parser.add_argument("--executable", default=f"{target}/release/laser_profiler")
    parser.add_argument("--bags", default=str(ROOT / "bags"), help="directory whose subdirectories are recordings")
    parser.add_argument("--rounds", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60, help="longest run")
    parser.add_argument("--megabytes", type=float, default=400, help="largest memory")
    arguments = parser.parse_args()
    bags = sorted(path for path in pathlib.Path(arguments.bags).iterdir() if path.is_dir())
    codes, kinds, failures = {}, {}, []
    longest = largest = 0.0
    for number in range(arguments.rounds):
        chance = random.Random(f"{arguments.seed} {number}")
        with tempfile.TemporaryDirectory() as place:
            bag = pathlib.Path(place) / "bag"
            shutil.copytree(chance.choice(bags), bag)
            # Mostly the data, sometimes the description.
            files = sorted(bag.iterdir(), key=lambda path: path.suffix != ".mcap")
            path = files[0] if chance.random() < 0.8 else chance.choice(files)
            data = bytearray(path.read_bytes())
            for _ in range(chance.randint(1, 4)):
                if data:
                    kind = damage(data, chance)
                    kinds[kind] = kinds.get(kind, 0) + 1
            path.write_bytes(data)
            verbs = [["info", str(bag)], ["replay", str(bag), "-o", f"{place}/out"],
                     ["recover", str(bag), "-o", f"{place}/mended"]]
            for verb in verbs:
                code, seconds, megabytes = run([arguments.executable, *verb], arguments.seconds)
                key = f"{verb[0]} {code}"
                codes[key] = codes.get(key, 0) + 1
                longest, largest = max(longest, seconds), max(largest, megabytes)
                if code not in (0, 1, 3) or megabytes > arguments.megabytes:
                    kept = tempfile.mkdtemp(prefix="damaged_")
                    shutil.copytree(bag, f"{kept}/bag")
                    failures.append({"round": number, "verb": verb[0], "code": code, "megabytes": megabytes,
                                     "kept": kept})
    print(json.dumps({"rounds": arguments.rounds, "seed": arguments.seed, "exit_codes": dict(sorted(codes.items())),
                      "damage": dict(sorted(kinds.items())), "longest_s": round(longest, 2),
                      "largest_mb": round(largest, 1), "failures": failures}))
    raise SystemExit(1 if failures else 0)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    main()
