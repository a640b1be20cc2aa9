"""Sends a range of shots to OpenCue to be decoded, one frame each: docs/FARM.md.

Lies beside opencue_shots.py, and needs what that needs.
"""

import argparse
import shlex

from opencue_shots import add_job_options, given, launcher, parsed, send

FORMATS = ["usdc", "usdz", "abc", "glb", "gltf", "vat", "obj", "ply", "npy", "pc2", "mdd", "mcx"]
# Folders with a file for each frame, and one of textures.
ENDINGS = {"obj": "/", "ply": "/*.ply", "vat": ".vat/"}


def decode_line(args):
    """The command of every shot."""
    shot = args.shot_name
    words = [args.program, "decode", f"{args.containers}/{shot}.cager"]
    if args.onto:
        words += ["--onto", f"{args.captures}/{shot}/{args.onto}"]
    words += given(args, "part")
    words += ["-o", f"{args.output}/{shot}{ENDINGS.get(args.format, '.' + args.format)}"]
    # A frame that is tried again replaces what an earlier try has written.
    words += ["--overwrite", "--threads", "2", "--memory", "2GB"]
    return " ".join(map(shlex.quote, words))


def parse(words=None):
    """The command line."""
    parser = argparse.ArgumentParser(description="Decodes a range of shots on OpenCue, one frame each.")
    parser.add_argument("containers", help="folder that has SHOT.cager for each shot, by its absolute path")
    parser.add_argument("output", help="folder for SHOT.usdc and so on, by its absolute path; it must be there")
    parser.add_argument("--format", choices=FORMATS, default="usdc",
                        help="what is written (usdc); obj and ply are a folder with a file for each frame")
    parser.add_argument("--part", action="append",
                        help="a part to write: its path, its name or a glob; may be given several times")
    parser.add_argument("--onto", help="file of USD that the shots came from, in the shot's folder; layers on top of it "
                        "are written")
    parser.add_argument("--captures", help="folder that has one folder for each shot, by its absolute path, for --onto")
    add_job_options(parser, "cager-decode")
    args = parsed(parser, words)
    if args.onto and not args.captures:
        parser.error("--onto: lies in the shot's folder; give the folder of these with --captures")
    return args


def main():
    """Sends the job, or prints it."""
    args = parse()
    send(args, launcher(args, "decode", decode_line(args)))


if __name__ == "__main__":
    main()
