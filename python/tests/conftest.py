# SPDX-License-Identifier: Apache-2.0
import pathlib

import pytest

import lockstep as ls

MODELS = pathlib.Path(__file__).parents[2] / "tests" / "models"


def gripper_model():
    model = ls.from_urdf(MODELS / "gripper.urdf")
    for name, kp, kd in (("shoulder_yaw", 60, 6), ("shoulder_pitch", 120, 12), ("elbow", 60, 6), ("knuckle", 8, 0.3)):
        model.joints[name].drive = ls.Drive(kp=kp, kd=kd)
    model.sites.append(ls.Site("tip", "left_tip", ls.pose((0.0, 0.0, 0.045))))
    return model


VARIED = ["gear_ratio", "offset", "mass"]


@pytest.fixture(scope="session")
def plan():
    return ls.compile(gripper_model(), vary=VARIED)


@pytest.fixture
def batch(plan):
    return plan.batch(9, threads=1, seed=7)
