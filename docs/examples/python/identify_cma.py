# Finds parameters of an arm from a recorded motion. SPDX-License-Identifier: Apache-2.0
"""CMA-ES (Hansen 2016) of rollouts: each candidate is an environment with frictions, dampings and masses of its own, and
all of a generation are stepped in one call. Needs numpy alone. `mpirun -n 4 python3 identify_cma.py --mpi` shares each
generation among ranks, and finds the same numbers."""

import argparse
import pathlib

import numpy as np

import lockstep as ls
from lockstep.ranks import ids_of

URDF = pathlib.Path(__file__).parents[3] / "tests" / "models" / "gripper.urdf"
JOINTS, LINKS = ["shoulder_yaw", "shoulder_pitch", "elbow"], ["upper_arm", "forearm"]
STEPS, SUBSTEPS = 200, 4


def plan():
    model = ls.from_urdf(URDF)
    for joint in [*JOINTS, "knuckle"]:
        model.joints[joint].drive = ls.Drive(kp=20, kd=0.5)
    return ls.compile(model, integrator="euler", vary=["friction", "damping", "mass"])


def columns(compiled):
    """(field, column) of each parameter that is looked for."""
    names = [("friction", joint) for joint in JOINTS] + [("damping", joint) for joint in JOINTS]
    names += [("mass", link) for link in LINKS if link in compiled.parameter_rows("mass")]
    return [(field, compiled.parameter_rows(field).index(name), name) for field, name in names]


def motions(batch, found, candidates, controls):
    """[n, T, nv] positions of the arm with these parameters, one environment each."""
    batch.reset()
    for k, (field, column, _) in enumerate(found):
        batch.parameter(field)[:, column] = candidates[:, k]
    records, faults = batch.rollout(None, controls, record="q", substeps=SUBSTEPS)
    return np.where((faults == 0)[:, None, None], records, np.inf)


def cma_es(cost, start, sigma, generations, population, random, report):
    """The mean of the last generation. cost([n, k]) -> [n]."""
    size, mean, path, path_sigma, covariance = len(start), start, 0.0, 0.0, np.eye(len(start))
    weights = np.log(population / 2 + 0.5) - np.log(np.arange(1, population // 2 + 1))
    weights /= weights.sum()
    effective = 1 / (weights ** 2).sum()
    c_sigma = (effective + 2) / (size + effective + 5)
    damping = 1 + 2 * max(0, np.sqrt((effective - 1) / (size + 1)) - 1) + c_sigma
    c_path = (4 + effective / size) / (size + 4 + 2 * effective / size)
    c_one = 2 / ((size + 1.3) ** 2 + effective)
    c_rank = min(1 - c_one, 2 * (effective - 2 + 1 / effective) / ((size + 2) ** 2 + effective))
    expected = np.sqrt(size) * (1 - 1 / (4 * size) + 1 / (21 * size ** 2))
    for generation in range(1, generations + 1):
        values, axes = np.linalg.eigh(covariance)
        root = axes * np.sqrt(np.maximum(values, 1e-20))
        steps = random.standard_normal((population, size)) @ root.T
        costs = cost(mean + sigma * steps)
        best = steps[np.argsort(costs)[:population // 2]]
        step = weights @ best
        mean = mean + sigma * step
        whitened = axes @ ((axes.T @ step) / np.sqrt(np.maximum(values, 1e-20)))
        path_sigma = (1 - c_sigma) * path_sigma + np.sqrt(c_sigma * (2 - c_sigma) * effective) * whitened
        length = np.linalg.norm(path_sigma)
        steady = length / np.sqrt(1 - (1 - c_sigma) ** (2 * generation)) < (1.4 + 2 / (size + 1)) * expected
        path = (1 - c_path) * path + steady * np.sqrt(c_path * (2 - c_path) * effective) * step
        covariance = (1 - c_one - c_rank) * covariance + c_one * np.outer(path, path) + c_rank * (best.T * weights) @ best
        sigma *= np.exp(c_sigma / damping * (length / expected - 1))
        if generation % 10 == 0:
            report(f"generation {generation:3d}  error {np.sqrt(costs.min()):.2e} rad  step {sigma:.1e}")
    return mean


def identify(compiled, generations=60, population=64, seed=0, report=print, comm=None):
    """Returns names, true and found parameters. With a communicator of MPI each rank has a share of the population."""
    random = np.random.default_rng(seed)  # the same on all ranks, and so are the candidates
    first, own = ids_of(comm.rank, comm.size, population) if comm else (0, population)
    found, batch = columns(compiled), compiled.batch(own, dtype="f8")
    model = np.array([compiled_value if (compiled_value := batch.parameter(field)[0, column]) > 0 else 0.1
                      for field, column, _ in found])
    times = np.arange(STEPS) / STEPS
    one = 0.6 * np.sin(2 * np.pi * (times[:, None] * np.arange(1, 1 + len(compiled.driven_dofs)) + 0.2))
    controls = np.broadcast_to(one, (own, *one.shape))  # all the same memory
    truth = model * np.exp(random.uniform(-0.7, 0.7, len(model)))
    recorded = motions(batch, found, np.tile(truth, (own, 1)), controls)[0]

    def cost(logarithms):
        error = motions(batch, found, model * np.exp(logarithms[first : first + own]), controls) - recorded
        costs = (error ** 2).mean(axis=(1, 2))
        return np.concatenate(comm.allgather(costs)) if comm else costs

    logarithms = cma_es(cost, np.zeros(len(model)), 0.3, generations, population, random, report)
    return [f"{field} {name}" for field, _, name in found], truth, model * np.exp(logarithms)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=60)
    parser.add_argument("--mpi", action="store_true", help="share the population among the ranks of mpirun")
    options = parser.parse_args()
    comm = None
    if options.mpi:
        from mpi4py import MPI
        comm = MPI.COMM_WORLD
    is_root = comm is None or comm.rank == 0
    told = print if is_root else lambda line: None
    for name, true, found in zip(*identify(plan(), options.generations, report=told, comm=comm)):
        told(f"{name:24s} true {true:8.4f}  found {found:8.4f}")


if __name__ == "__main__":
    main()
