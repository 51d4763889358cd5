# A lockstep.Model as MJCF, for MuJoCo as a peer. SPDX-License-Identifier: Apache-2.0
"""Joints with position limits, servos with effort limits, mimics as joint equalities; no contacts. MuJoCo has no limits of
velocity."""

import math
import xml.etree.ElementTree as xml

import numpy as np


def numbers(values):
    return " ".join(repr(float(value)) for value in np.ravel(values))


def quaternion(pose):
    """w, x, y, z of a 4 x 4 pose, by its largest component."""
    r = np.asarray(pose)[:3, :3]
    squares = np.array([1 + np.trace(r), *(1 + 2 * np.diag(r) - np.trace(r))])
    largest = int(np.argmax(squares))
    root = math.sqrt(squares[largest])
    q = np.empty(4)
    q[largest] = root / 2
    skew = (r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1])
    if largest == 0:
        q[1:] = np.array(skew) / (2 * root)
    else:
        i = largest - 1
        q[0] = skew[i] / (2 * root)
        for k in range(3):
            if k != i:
                q[1 + k] = (r[i, k] + r[k, i]) / (2 * root)
    return q


def mjcf(model, dt, integrator="implicitfast", stiff=True):
    """solref of the couplings is two steps if they are stiff, the shortest that is stable by itself."""
    root = xml.Element("mujoco", model=model.name)
    xml.SubElement(root, "compiler", autolimits="true", balanceinertia="true", boundmass="1e-9", boundinertia="1e-12")
    option = xml.SubElement(root, "option", timestep=repr(dt), integrator=integrator, gravity=numbers(model.gravity),
                            jacobian="dense", solver="Newton", iterations="10", ls_iterations="10")
    xml.SubElement(option, "flag", contact="disable", warmstart="enable")
    world = xml.SubElement(root, "worldbody")

    def body(parent, link, pose, joint):
        at = np.asarray(pose)
        own = xml.SubElement(parent, "body", name=link.name, pos=numbers(at[:3, 3]), quat=numbers(quaternion(at)))
        if link.inertia.mass > 0:
            i = np.asarray(link.inertia.about_center)
            full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
            xml.SubElement(own, "inertial", pos=numbers(link.inertia.center), mass=repr(float(link.inertia.mass)),
                           fullinertia=numbers(full))
        if joint is not None and joint.kind != "fixed":
            given = {"range": numbers([joint.lower, joint.upper])} if math.isfinite(joint.lower) else {}
            kind = "slide" if joint.kind == "prismatic" else "hinge"
            xml.SubElement(own, "joint", name=joint.name, type=kind, axis=numbers(joint.axis),
                           damping=repr(joint.damping), armature=repr(joint.armature),
                           frictionloss=repr(joint.friction), **given)
        for child in model.joints:
            if child.parent == link.name:
                body(own, model.links[child.child], child.origin, child)

    carried = {joint.child for joint in model.joints}
    for link in model.links:
        if link.name not in carried:
            body(world, link, np.eye(4), None)
    equality = xml.SubElement(root, "equality")
    for coupling in model.couplings:
        (leader, ratio), = coupling.terms
        short = {"solref": f"{2 * dt!r} 1"} if stiff else {}
        xml.SubElement(equality, "joint", joint1=coupling.joint, joint2=leader,
                       polycoef=numbers([-coupling.offset, -ratio, 0, 0, 0]), **short)
    actuator = xml.SubElement(root, "actuator")
    for joint in model.joints:
        if joint.drive.kp > 0:
            force = {"forcerange": numbers([-joint.effort_limit, joint.effort_limit])}
            xml.SubElement(actuator, "position", name=joint.name, joint=joint.name, kp=repr(joint.drive.kp),
                           kv=repr(joint.drive.kd), **(force if math.isfinite(joint.effort_limit) else {}))
    return xml.tostring(root, encoding="unicode")
