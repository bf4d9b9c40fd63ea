"""Knits a wardrobe, every garment in every fabric, on the workers of a Ray cluster. See README.md beside this file.

A job is one drape into a folder of its own: by the Python package in the worker, or, with `--binary`, by a call of the command. It is done
when its report stands there under its final name: warpknit renames whole files only, and its report last. So jobs that are done are never started again, and one whose worker died is started anew.
"""

import argparse
import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import ray

MESHES = Path(__file__).resolve().parents[2] / "meshes"
GARMENTS = {
    "pinch": ["pinch_flat.obj", "pinch_draped.obj"],
    "tube": ["tube_flat.obj", "tube_draped.obj"],
    "skirt": ["skirt_flat.obj", "skirt_draped.obj"],
    "tshirt": ["tshirt.obj"],
}
# A worker may die so often under one job before the job is given up.
RETRIES = 5


def label(fabric):
    """A fabric in the name of a job: a fabric file without its folder and ending."""
    return Path(fabric).stem


def part_of(arguments, part):
    """The name of the job of one part: another fabric or number of parts is another job."""
    return f"{arguments.large}-{label(arguments.fabrics[0])}-part-{part}-of-{arguments.tiles}"


def jobs_of(arguments):
    """Each job's name, with the command's arguments and the endings of its files."""
    common = ["--renderer", "cpu", "--threads", "1", "--quiet"]
    for garment in arguments.garments:
        meshes = [str(MESHES / name) for name in GARMENTS[garment]]
        for fabric in arguments.fabrics:
            name = f"{garment}-{label(fabric)}-{arguments.size}"
            yield name, [*meshes, "--fabric", fabric, "--size", arguments.size, *common], ["png", "json"]
    meshes = [str(MESHES / name) for name in GARMENTS[arguments.large]]
    for part in range(1, arguments.tiles + 1):
        tile = ["--fabric", arguments.fabrics[0], "--tile", f"{part}/{arguments.tiles}"]
        yield part_of(arguments, part), [*meshes, *tile, *common], ["csv", "json"]


def note(out, name, event):
    """Adds a line to the log; a line this short is written at once, whoever else writes."""
    with open(out / "attempts.log", "a") as log:
        log.write(f"{time.time():.3f} {name} {event}\n")


def notes(out):
    """The log's lines: job and event."""
    path = out / "attempts.log"
    return [line.split(" ", 2)[1:] for line in path.read_text().splitlines()] if path.exists() else []


def is_done(out, name):
    return (out / name / f"{name}.json").exists()


def drape(flags, files):
    """Drapes by the Python package what the command's flags say: meshes, fabric and size."""
    # Here and not above: machines that only start jobs need no package.
    import warpknit

    meshes = flags[: flags.index("--fabric")]
    fabric, size = (flags[flags.index(flag) + 1] for flag in ("--fabric", "--size"))
    fabric = warpknit.Fabric.load(fabric) if fabric.endswith(".toml") else warpknit.Fabric.named(fabric)
    yarns = warpknit.drape(warpknit.Garment.load(*meshes), fabric)
    yarns.save(*files, size=tuple(int(side) for side in size.split("x")))


@ray.remote(num_cpus=1, max_retries=RETRIES)
def knit(binary, out, name, arguments, endings):
    """One job, at most once: what happened, in a word."""
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "w") as lock:
        # The program inherits the lock: where it outlives a worker that was killed, the next worker waits for it here.
        fcntl.flock(lock, fcntl.LOCK_EX)
        if is_done(out, name):
            return "done before"
        # What a killed program was writing; it never got its final name.
        for partial in folder.glob(".warpknit-*"):
            partial.unlink()
        files = [folder / f"{name}.{ending}" for ending in endings]
        if binary is None:
            note(out, name, f"start worker={os.getpid()} program={os.getpid()}")
            drape(arguments, files)
            note(out, name, "done")
            return "knitted"
        outputs = [flag for file in files for flag in ("-o", str(file))]
        command = [binary, "drape", *arguments, *outputs]
        program = subprocess.Popen(command, pass_fds=[lock.fileno()], stderr=subprocess.PIPE, text=True)
        note(out, name, f"start worker={os.getpid()} program={program.pid}")
        _, message = program.communicate()
        if program.returncode != 0:
            note(out, name, "failed")
            # No death of a worker, which Ray tries again, but an answer: the same arguments would fail again.
            raise RuntimeError(f"{name}: {message.strip()}")
        note(out, name, "done")
        return "knitted"


def run(arguments):
    """All jobs that are not done yet; how many were knitted, and what failed."""
    jobs = list(jobs_of(arguments))
    waiting = {knit.remote(arguments.binary, arguments.out, *job): job[0] for job in jobs if not is_done(arguments.out, job[0])}
    skipped, knitted, failures = len(jobs) - len(waiting), 0, []
    while waiting:
        (finished,), _ = ray.wait(list(waiting), num_returns=1)
        del waiting[finished]
        try:
            knitted += ray.get(finished) == "knitted"
        except ray.exceptions.RayError as error:
            failures.append(str(error).splitlines()[-1])
    print(f"{len(jobs)} jobs: {knitted} knitted, {skipped} were done before, {len(failures)} failed")
    for failure in failures:
        print(f"error: {failure}", file=sys.stderr)
    if arguments.tiles and not failures:
        join(arguments)
    return not failures


def join(arguments):
    """The parts' data points as one file, under its name only when it is whole."""
    target = arguments.out / f"{arguments.large}.csv"
    names = [part_of(arguments, part) for part in range(1, arguments.tiles + 1)]
    with tempfile.NamedTemporaryFile("wb", dir=arguments.out, delete=False) as whole:
        for number, name in enumerate(names):
            with open(arguments.out / name / f"{name}.csv", "rb") as part:
                header = part.readline()
                if number == 0:
                    whole.write(header)
                shutil.copyfileobj(part, whole)
    os.replace(whole.name, target)
    points = sum(json.loads((arguments.out / name / f"{name}.json").read_text())["data_points"] for name in names)
    print(f"{target.name}: {points} data points out of {len(names)} parts")


def kill_a_worker(out, enough, killed):
    """Once some jobs are done, kills a worker in the middle of another one, and its program with it, as a machine that dies does."""
    while True:
        events = notes(out)
        done = {name for name, event in events if event == "done"}
        running = [(name, event) for name, event in events if event.startswith("start") and name not in done]
        if len(done) >= enough and running:
            name, event = running[-1]
            worker, program = (int(word.partition("=")[2]) for word in event.split()[1:])
            os.kill(worker, signal.SIGKILL)
            try:
                os.kill(program, signal.SIGKILL)
            except ProcessLookupError:
                # It was quicker; the lock tells the next worker.
                pass
            killed.update(name=name, done=done, times=times(out, done))
            print(f"killed the worker of {name} when {len(done)} jobs were done")
            return
        time.sleep(0.005)


def times(out, names):
    """When each file of some jobs was written."""
    return {path: path.stat().st_mtime_ns for name in names for path in (out / name).glob(f"{name}.*")}


def is_whole(path):
    data = path.read_bytes()
    match path.suffix:
        case ".png":
            return data.startswith(b"\x89PNG\r\n\x1a\n") and data.endswith(b"IEND\xaeB`\x82")
        case ".json":
            return json.loads(data)["yarns"] > 0
        case ".csv":
            report = json.loads(path.with_suffix(".json").read_text())
            return data.endswith(b"\n") and data.count(b"\n") == report["data_points"] + 1
    return False


def expect(holds, words):
    if not holds:
        sys.exit(f"error: not so: {words}")


def check(arguments):
    """Runs with a worker killed on the way, then once more, and looks whether anything is lost or done twice."""
    out, killed = arguments.out, {}
    if out.exists() and any(out.iterdir()):
        sys.exit(f"error: {out} is not empty: name a new folder with --out")
    out.mkdir(parents=True, exist_ok=True)
    killer = threading.Thread(target=kill_a_worker, args=(out, 3, killed), daemon=True)
    killer.start()
    expect(run(arguments), "a job failed")
    killer.join(timeout=1)
    expect(killed, "all jobs were done before a worker could be killed: ask for more of them")

    jobs = list(jobs_of(arguments))
    wanted = {f"{name}.{ending}" for name, _, endings in jobs for ending in endings}
    found = [path for name, _, _ in jobs for path in (out / name).iterdir() if path.name != "lock"]
    expect(sorted(path.name for path in found) == sorted(wanted), "each output once, and nothing else")
    expect(all(map(is_whole, found)), "every output is whole")
    print(f"{len(found)} outputs of {len(jobs)} jobs are there, once each and whole")
    events = notes(out)
    starts = {name: sum(name == job and event.startswith("start") for job, event in events) for name, _, _ in jobs}
    ends = {name: sum(name == job and event == "done" for job, event in events) for name, _, _ in jobs}
    again = [name for name, count in starts.items() if count > 1]
    print(f"started again: {', '.join(again)}")
    expect(set(again) <= {killed["name"]} and starts[killed["name"]] <= 2, "only the killed job may be started twice")
    expect(all(ends[name] == 1 for name in ends if name != killed["name"]), "each job ends once")
    expect(times(out, killed["done"]) == killed["times"], "what was done before the death is as it was")

    before = times(out, starts)
    expect(run(arguments), "a job failed")
    expect(len(notes(out)) == len(events) and times(out, starts) == before, "a second start does nothing again")
    if arguments.tiles:
        whole = out / "whole.csv"
        meshes = [str(MESHES / name) for name in GARMENTS[arguments.large]]
        command = [arguments.binary, "drape", *meshes, "--fabric", arguments.fabrics[0], "--quiet", "-o", str(whole)]
        subprocess.run(command, check=True)
        expect(whole.read_bytes() == (out / f"{arguments.large}.csv").read_bytes(), "the parts are the whole")
        print(f"{arguments.large}.csv out of {arguments.tiles} parts is byte for byte what one run writes")
    print("nothing lost, nothing done twice")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--binary", help="the command to call [default: the Python package]")
    parser.add_argument("--out", type=Path, default=Path("wardrobe"), help="a folder that all workers see")
    parser.add_argument("--garments", nargs="+", choices=GARMENTS, default=list(GARMENTS))
    parser.add_argument("--fabrics", nargs="+", default=["tricot", "locknit", "satin"])
    parser.add_argument("--size", default="320x240", help="of the pictures")
    parser.add_argument("--workers", type=int, default=2, help="jobs at a time on this machine")
    parser.add_argument("--address", help="of a running cluster [default: a new one on this machine]")
    parser.add_argument("--large", choices=GARMENTS, default="skirt", help="the garment that --tiles shares out")
    parser.add_argument("--tiles", type=int, default=0, help="parts of its data points, in the first fabric, to be knitted apart and joined")
    parser.add_argument("--check", action="store_true", help="kill a worker on the way and look what came of it")
    arguments = parser.parse_args()
    if arguments.binary is not None:
        binary = shutil.which(arguments.binary)
        if binary is None:
            parser.error(f"there is no program {arguments.binary}: name it with --binary")
        arguments.binary = str(Path(binary).resolve())
    elif arguments.tiles:
        parser.error("the Python package has no tiles: name the command with --binary")
    arguments.out = arguments.out.resolve()
    local = {} if arguments.address else {"num_cpus": arguments.workers, "include_dashboard": False}
    # A worker has one processor, and so should its drape. The package reads this when it is first used.
    local["runtime_env"] = {"env_vars": {"RAYON_NUM_THREADS": "1"}}
    ray.init(address=arguments.address, log_to_driver=False, logging_level="error", **local)
    if arguments.check:
        check(arguments)
    elif not run(arguments):
        sys.exit(1)


if __name__ == "__main__":
    main()
