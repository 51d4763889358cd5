# What Batch.read() reads. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Sequence


@dataclass(frozen=True)
class Query:
    """A quantity of some joints, links or sites, times `scale`. rows: their names; None is all of them. points: of a
    height_scan, x and y of each from the link's origin, m, along where its x axis looks seen from above, and to the
    left.

    quantity                             rows    columns for each
    q, qd, q_target, qd_target, effort   joints  1
    link_pose, site_pose                 links, sites  7: x, y, z, quaternion w, x, y, z
    site_position                        sites   3
    link_velocity, site_velocity         links, sites  6: angular, then linear, world axes
    link_twist, site_twist               links, sites  6: the same in the axes of the link or site
    link_gravity, site_gravity           links, sites  3: unit vector along gravity in these axes; 0 without gravity
    link_contact_force                   links   3: the sum of contact_force on it, N, world axes
    link_contacts                        links   1: how many pairs with it bear a force
    height_scan                          links   1 for each point: m that the link's origin is above the ground there,
                                                 inf where there is none. Half-spaces, upright height fields and boxes
                                                 that stand in the world are ground
    coupling_error                       couplings  1
    loop_error                           loops   2: distance, m; angle, rad
    loop_force                           loops   6: force, N, and torque, N m, on the second link, world axes
    root_pose, root_twist                -       7, 6 for each floating root
    kinetic_energy, potential_energy     -       1
    contact_force                        pairs   3: on the second collider, N, world axes; of a step that a leapfrog
                                                 takes in parts (fast motion), that of the last part
    contact_normal_force                 pairs   1: N
    contact_gap, contact_slip            pairs   1: m, m/s
    contact_point                        -       11 for each slot: point, normal, force, gap, speed along the surface
    unfinished_contacts                  -       1
    solve_counts                         -       11: of the last call of step(): steps, pairs near, points live, points
                                                 pressing, solves, passes, rounds, trials; points, rounds, trials of
                                                 the tile

    With compile(record_efforts=True):
    drive_effort                         joints  1: mean over the last step, after the limit, N m or N
    drive_effort_peak, drive_effort_mean joints  1: of the last call of step()

    With compile(record_contacts=True):
    contact_peak_force                   pairs   1: largest size in a step of the last call, N
    contact_mean_force                   pairs   3: over the last call, N, world axes
    contact_time, contact_air_time       pairs   1: of the present contact or flight, s
    contact_last_time, contact_last_air_time  pairs   1: of those before, s
    contact_first_touch                  pairs   1: 1 if a flight has ended in the last call

    With compile(record_accelerations=True), means over the last step:
    joint_acceleration                   joints  1: rad/s^2 or m/s^2
    link_acceleration, site_acceleration links, sites  6: angular acceleration, what an accelerometer measures; own axes
    joint_wrench                         joints  6: force, torque through the joint on its child link, in its axes

    Forces are those of the last step, whatever was written since, and 0 after a reset; the rest is that of the present
    state. A gap is infinite where colliders are not near. What a plan does not have gives no columns. Raises UsageError
    for unknown quantities and rows, for a scale that is not finite, and for what compile() was not told to record.
    """

    quantity: str
    rows: Optional[Sequence[str]] = None
    scale: float = 1.0
    points: Optional[Sequence[Sequence[float]]] = None
