#!/usr/bin/env python3
"""Renders a Mitsuba scene with Mitsuba 3 for `bench report`, and prints how long each part took as one line of JSON.

load_s    reading the scene, its textures and meshes, and building the acceleration structure
warmup_s  one render with another seed, thrown away: just-in-time compilation, first touch of memory
render_s  the render that is kept, from the call until all values are in memory
cpu_s     processor time of all threads during render_s

Samples are split into passes of at most LANES samples in all, each with a seed of its own, and averaged: the LLVM variants
hold the state of every sample of a pass in memory.
"""

import argparse
import json
import os
import sys
import time

# On two cores, passes of 2^16 to 2^23 samples were equally fast within 10 %.
LANES = 1 << 22


def arguments():
    parser = argparse.ArgumentParser()
    parser.add_argument("--variant", required=True, help="such as llvm_ad_rgb or scalar_rgb")
    parser.add_argument("--integrator", help="in place of the scene's: path, volpath, volpathmis, ptracer, ...")
    parser.add_argument("--scene", required=True)
    parser.add_argument("--spp", type=int, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--width", type=int, required=True)
    parser.add_argument("--height", type=int, required=True)
    parser.add_argument("--max-depth", type=int, required=True, help="edges of the longest path; -1 = unbounded")
    parser.add_argument("--threads", type=int, required=True)
    parser.add_argument("--out", required=True, help="a PFM (writing an EXR hangs in 3.9.1 with one thread)")
    return parser.parse_args()


def restrict(threads):
    """Leaves the process as many processors as it may use threads.

    Mitsuba starts one thread for each: this must come before it is imported. (A pool that drjit.set_thread_count resizes used one
    core less in 3.9.1.)
    """
    available = sorted(os.sched_getaffinity(0))
    if threads > len(available):
        sys.exit(f"{threads} threads were asked for, but there are {len(available)} processors")
    os.sched_setaffinity(0, available[-threads:])


def main():
    args = arguments()
    restrict(args.threads)
    try:
        import drjit as dr
        import mitsuba as mi
    except ImportError as e:
        sys.exit(f"{e}; install it for {sys.executable} with: {sys.executable} -m pip install mitsuba")
    if args.variant not in mi.variants():
        sys.exit(f"Mitsuba {mi.__version__} has no variant {args.variant!r}, only {', '.join(mi.variants())}")
    try:
        mi.set_variant(args.variant)
    except ImportError as e:
        sys.exit(f"variant {args.variant}: {e}; the LLVM variants need libLLVM: install it from the system's packages, or name it in"
                 " DRJIT_LIBLLVM_PATH")
    jit = args.variant.startswith(("llvm", "cuda"))
    mi.set_log_level(mi.LogLevel.Error)

    def settle():
        if jit:
            dr.sync_thread()

    started = time.perf_counter()
    parameters = {"resx": args.width, "resy": args.height, "max_depth": args.max_depth, "spp": 1}
    if args.integrator:
        parameters["integrator"] = args.integrator
    scene = mi.load_file(args.scene, **parameters)
    settle()
    loaded = time.perf_counter()

    pixels = args.width * args.height
    passes = -(-args.spp * pixels // LANES) if jit else 1
    counts = [args.spp // passes + (i < args.spp % passes) for i in range(passes)]

    def render(spp, seed):
        image = mi.render(scene, spp=spp, seed=seed)
        if jit:
            dr.eval(image)
            dr.sync_thread()
        return image

    if jit:
        render(counts[0], 0x7FFFFFFF)
    warm, cpu = time.perf_counter(), time.process_time()
    total = None
    for i, spp in enumerate(counts):
        image = render(spp, args.seed * passes + i) * (spp / args.spp)
        total = image if total is None else total + image
    if jit:
        dr.eval(total)
    settle()
    rendered, cpu = time.perf_counter(), time.process_time() - cpu
    mi.Bitmap(total).write(args.out)
    print(json.dumps({
        "load_s": loaded - started,
        "warmup_s": warm - loaded,
        "render_s": rendered - warm,
        "cpu_s": cpu,
        "about": f"Mitsuba {mi.__version__} {args.variant}",
    }))


if __name__ == "__main__":
    main()
