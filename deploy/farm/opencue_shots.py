"""Sends a range of shots to OpenCue, one frame each: docs/FARM.md. Needs opencue-pyoutline and packaging.

The workers need the program alone: Cuebot puts the shot's number in place of #ZFRAME#, and RQD has a shell run the line.
"""

import argparse
import shlex

import outline
import outline.cuerun
from outline.modules.shell import Shell


def given(args, option):
    """The words of an option of the program, if it is given, once for each value."""
    values = getattr(args, option) or []
    values = values if isinstance(values, list) else [values]
    return [word for value in values for word in (f"--{option.replace('_', '-')}", str(value))]


def encode_line(args):
    """The command of every shot."""
    shot = args.shot_name
    folder = f"{args.captures}/{shot}"
    words = [args.program, "encode", "--rest", f"{folder}/{args.rest}", "--frames", f"{folder}/{args.frames}"]
    if args.cage:
        words += ["--cage", f"{folder}/{args.cage}"]
    for option in ("prim", "up", "unit", "sample_rate", "server"):
        words += given(args, option)
    words += ["--max-error", str(args.max_error), "-o", f"{args.output}/{shot}.cager", "--report", f"{args.output}/{shot}.json"]
    # A frame that is tried again replaces what an earlier try has written.
    words += ["--overwrite", "--threads", "2", "--memory", "2GB"]
    return " ".join(map(shlex.quote, words))


def launcher(args, layer, line):
    """The job, ready to be launched or to be written as a job specification; its command is the same for all shots."""
    job = outline.Outline(args.name, frame_range=args.shots, show=args.show, shot=args.sequence)
    job.add_layer(Shell(layer, command=line, range=args.shots, chunk=1, cores=2, memory="4g"))
    return outline.cuerun.OutlineLauncher(job, maxretries=1, nomail=True)


def add_job_options(parser, name):
    """The options of a job of this name, whatever it does with shots."""
    parser.add_argument("--shots", required=True, help="numbers of the shots: 10-120x10, or 10,20,45")
    parser.add_argument("--shot-name", default="sh#ZFRAME#",
                        help="name of a shot; #ZFRAME# is its number in four digits, #IFRAME# its number alone")
    parser.add_argument("--program", default="cager", help="the program on the workers")
    parser.add_argument("--name", default=name, help="name of the job")
    parser.add_argument("--show", default="testing", help="show of the job, as Cuebot knows it")
    parser.add_argument("--sequence", default="shots", help="what Cuebot is told as the job's shot")
    parser.add_argument("--print", action="store_true", help="print the job specification and send nothing")


def parsed(parser, words):
    """The command line, if it names every shot differently."""
    args = parser.parse_args(words)
    if not any(number in args.shot_name for number in ("#ZFRAME#", "#IFRAME#")):
        parser.error("--shot-name: has neither #ZFRAME# nor #IFRAME#, so all shots would be one file")
    return args


def parse(words=None):
    """The command line."""
    parser = argparse.ArgumentParser(description="Encodes a range of shots on OpenCue, one frame each.")
    parser.add_argument("captures", help="folder that has one folder for each shot, by its absolute path")
    parser.add_argument("output", help="folder for SHOT.cager and SHOT.json, by its absolute path; it must be there")
    parser.add_argument("--rest", default="rest.obj", help="rest pose, in the shot's folder; ../rest.obj is one for all")
    parser.add_argument("--frames", default="frames.npy", help="capture, in the shot's folder")
    parser.add_argument("--cage", help="cage, in the shot's folder; without it one is designed for each shot")
    parser.add_argument("--prim", action="append",
                        help="the meshes to take: a path, a name or a glob; may be given several times")
    parser.add_argument("--up", choices=["y", "z"],
                        help="axis that points up in the capture, where another one does in the rest pose")
    parser.add_argument("--unit", choices=["mm", "cm", "m", "in", "ft"],
                        help="what one unit is, in files that do not say it")
    parser.add_argument("--sample-rate", type=float, help="frames to take for each second of a .glb, .gltf or .fbx")
    parser.add_argument("--max-error", type=float, default=0.001, help="a fraction of the rest pose's diagonal (0.001)")
    parser.add_argument("--server", help="address of a service that computes, instead of the workers")
    add_job_options(parser, "cager-encode")
    return parsed(parser, words)


def send(args, job):
    """Sends a job, or prints it."""
    if args.print:
        print(job.serialize(use_pycuerun=False))
    else:
        job.launch(use_pycuerun=False)


def main():
    """Sends the job, or prints it."""
    args = parse()
    send(args, launcher(args, "encode", encode_line(args)))


if __name__ == "__main__":
    main()
