# SPDX-License-Identifier: Apache-2.0
import copy
import pickle

import numpy as np
import pytest
from conftest import MODELS, gripper_model

import lockstep as ls


def test_elements_by_name_and_number():
    model = gripper_model()
    assert model.joints["knuckle"] is model.joints[model.joints.position("knuckle")]
    assert "knuckle" in model.joints and "nothing" not in model.joints
    assert model.joints["elbow"].upper == 1.2
    assert model.couplings["left_tip_joint"].terms == [("knuckle", 1.0)]  # q_tip + 1 q_knuckle = 0
    with pytest.raises(KeyError, match="shoulder_yaw"):
        model.joints["nothing"]


def test_models_are_plain_data():
    model = gripper_model()
    for other in (copy.deepcopy(model), pickle.loads(pickle.dumps(model)), model.copy()):
        assert other == model
        other.joints["elbow"].damping += 1
        assert other != model


def test_a_model_goes_to_cpp_and_back_without_losing_a_bit():
    model = gripper_model()
    model.joints["elbow"].limit_softness = ls.Frequency(30.0, 0.7)
    model.couplings[0].softness = ls.Spring(40.0, 1.5)
    model.couplings[1].softness = ls.ErpCfm(0.3, 0.1)
    model.links[2].gravity = 0.3
    model.joints["elbow"].drive.position_target = 0.1234567890123456789
    assert ls.compile(model).model == model
    again = pickle.loads(pickle.dumps(ls.compile(model, dt=1 / 500, vary="mass", ignore={"friction": True})))
    assert again.model == model and again.dt == 1 / 500 and again.vary == ["mass"]
    assert again.settings["ignore"] == {"friction": True}


def test_a_model_in_code_moves_as_theory_says():
    model = ls.Model("pendulum", gravity=(0, 0, -9.81))
    model.links = [ls.Link("base"), ls.Link("bob", ls.Inertia(2.0, (0, 0, -0.5)))]
    model.joints = [ls.Joint("hinge", "revolute", "base", "bob", axis=(0, 1, 0), position=0.01)]
    batch = ls.compile(model, dt=1e-3).batch(1, dtype="f8")
    batch.step(700)
    assert batch.q[0, 0] == pytest.approx(0.01 * np.cos(np.sqrt(9.81 / 0.5) * 0.7), abs=1e-6)


def test_a_ball_turns_by_its_rotation_vector():
    model = ls.Model("top", gravity=(0, 0, 0))
    model.links = [ls.Link("base"), ls.Link("top", ls.Inertia.box(1.0, (0.2, 0.2, 0.2)))]
    parts = model.add_ball("ball", "base", "top")
    spin = np.array([1.0, -2.0, 0.5])
    for part, speed in zip(parts, spin):
        part.velocity = speed
    batch = ls.compile(model, integrator="leapfrog").batch(2)
    assert batch.plan.model.joints == model.joints
    batch.step(240)
    np.testing.assert_allclose(batch.q[1], spin, atol=1e-4)  # for a second
    with pytest.raises(ls.ModelError, match="is taken"):
        model.add_ball("ball", "base", "top")


def test_a_rope_holds_what_hangs_on_it():
    model = ls.Model("rope")
    model.links = [ls.Link("weight", ls.Inertia.box(1.0, (0.1, 0.1, 0.1)))]
    model.roots = [ls.Root("weight", floating=True, pose=ls.pose((0.0, 0.0, -0.3)))]
    model.joints = [ls.Joint("rope", "tendon", upper=0.5, path=[ls.TendonSegment("", "weight")])]
    batch = ls.compile(model, dt=1e-3).batch(2, dtype="f8")
    assert batch.plan.model.joints[0].path == model.joints[0].path
    batch.step(1000)
    assert batch.q[1, 0] == pytest.approx(0.5, abs=1e-5)
    assert batch.root_pose[1, 2] == pytest.approx(-0.5, abs=1e-5)
    model.joints[0].path[0].share = 0.0
    with pytest.raises(ls.ModelError, match="share of a segment"):
        ls.compile(model)


def test_a_servo_on_a_tendon_drives_a_differential():
    model = gripper_model()
    model.couplings, model.contacts, model.colliders = [], [], []
    for name, sign in (("sum", 1.0), ("difference", -1.0)):
        model.joints.append(ls.Joint(name, "tendon", drive=ls.Drive(kp=40.0, kd=4.0)))
        model.couplings.append(ls.Coupling(name, [("elbow", -1.0), ("knuckle", -sign)]))
    plan = ls.compile(model, dt=1e-3, ignore={"position_limits": True})
    assert {"sum", "difference"} <= set(plan.driven_dofs) and plan.model.joints["sum"].kind == "tendon"
    batch = plan.batch(2, dtype="f8")
    total, difference, elbow, knuckle = (plan.dof(name) for name in ("sum", "difference", "elbow", "knuckle"))
    batch.q_target[:, total], batch.q_target[:, difference] = 0.5, -0.3
    batch.step(2000)
    assert batch.q[:, total] == pytest.approx(batch.q[:, elbow] + batch.q[:, knuckle], abs=1e-12)
    assert batch.q[:, difference] == pytest.approx(batch.q[:, elbow] - batch.q[:, knuckle], abs=1e-12)
    assert np.abs(batch.q[:, [total, difference]] - [0.5, -0.3]).max() < 0.1


def test_errors_name_element_rule_and_remedy():
    model = gripper_model()
    model.joints["elbow"].damping = -1
    with pytest.raises(ls.ModelError) as caught:
        ls.compile(model)
    error = caught.value
    assert "elbow" in error.element and error.rule and error.remedy
    assert str(error) == f"{error.element}: {error.rule}; {error.remedy}"
    assert isinstance(error, ls.Error) and isinstance(error, ValueError)
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) and again.code == error.code == "model.joint"


def test_a_file_is_refused_for_all_reasons_at_once():
    link = "<link name='{}'><inertial><mass value='{}'/></inertial></link>"
    with pytest.raises(ls.ImportFileError) as caught:
        ls.from_urdf_text(f"<robot name='r'>{link.format('a', 'x')}{link.format('b', 'y')}</robot>")
    error = caught.value
    assert [element.rsplit("link ")[-1] for element, _, _ in error.reasons] == ["'a'", "'b'"]
    assert str(error) == "\n".join(f"{element}: {rule}; {remedy}" for element, rule, remedy in error.reasons)
    assert (error.element, error.rule, error.remedy) == error.reasons[0]
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) and again.reasons == error.reasons and again.code == "import"


@pytest.mark.parametrize(
    "change, kind, words",
    [
        (lambda m: setattr(m.joints["elbow"], "damping", "much"), TypeError, "elbow: damping"),
        (lambda m: setattr(m.joints["elbow"], "axis", (0, 1)), TypeError, "elbow: axis"),
        (lambda m: setattr(m.joints["elbow"], "kind", "hinge"), ls.ModelError, "hinge"),
        (lambda m: setattr(m.joints["elbow"], "drive", None), TypeError, "kp|drive"),
        (lambda m: setattr(m.couplings[0], "softness", 3.0), TypeError, "softness"),
        (lambda m: setattr(m, "gravity", "down"), TypeError, "gravity"),
    ],
)
def test_wrong_values_are_refused_by_name(change, kind, words):
    model = gripper_model()
    change(model)
    with pytest.raises((kind, AttributeError) if kind is TypeError else kind, match=words):
        ls.compile(model)


def test_wrong_settings_are_refused():
    model = gripper_model()
    with pytest.raises(ls.SettingsError, match="reduced"):
        ls.compile(model, method="magic")
    with pytest.raises(ls.SettingsError, match="gear_ratio"):
        ls.compile(model, vary=["gears"])
    with pytest.raises(ls.SettingsError, match="position_limits"):
        ls.compile(model, ignore="limits")
    with pytest.raises(ls.SettingsError, match="dt"):
        ls.compile(model, dt=0)
    with pytest.raises(TypeError, match="Model"):
        ls.compile("gripper.urdf")


def test_files(tmp_path):
    assert any("5 couplings" in line for line in ls.from_urdf(MODELS / "gripper.urdf").report)
    with pytest.raises(FileNotFoundError):
        ls.from_urdf(tmp_path / "nothing.urdf")
    (tmp_path / "bad.urdf").write_text("<robot><link></robot>")
    with pytest.raises(ls.ImportFileError, match="bad.urdf"):
        ls.from_urdf(tmp_path / "bad.urdf")
    with pytest.raises(ls.ImportFileError, match="here"):
        ls.from_urdf_text("no xml", "here")


def test_mjcf_files(tmp_path):
    text = """<mujoco><worldbody><body name="arm" pos="0 0 1"><joint name="hinge" axis="0 1 0" range="-90 90"/>
        <geom type="capsule" size=".02 .1"/></body></worldbody>
        <keyframe><key name="bent" qpos="0.5"/></keyframe></mujoco>"""
    (tmp_path / "arm.xml").write_text(text)
    for read in (ls.from_file, ls.from_mjcf):
        model = read(tmp_path / "arm.xml", keyframe="bent", body="arm")
        assert model.joints["hinge"].position == 0.5
        assert model.joints["hinge"].upper == pytest.approx(np.pi / 2)
    assert ls.from_mjcf_text(text).joints["hinge"].position == 0
    with pytest.raises(ls.ImportFileError, match="arm.xml:1.*from_|arm.xml:1.*import_mjcf_file"):
        ls.from_urdf(tmp_path / "arm.xml")
    loop = text.replace("<keyframe>", '<equality><connect body1="arm" anchor="0 0 0"/></equality><keyframe>')
    assert ls.from_mjcf_text(loop, loops="leave_out", soft="as_in_file").warnings
    with pytest.raises(ls.ImportFileError, match="neither an anchor nor sites"):
        ls.from_mjcf_text(loop.replace('anchor="0 0 0"', ""))
    with pytest.raises(ls.SettingsError, match="keep, leave_out"):
        ls.from_mjcf_text(loop, loops="cut")
    with pytest.raises(ls.SettingsError, match="density"):
        ls.from_mjcf_text(text, density=1000)
    with pytest.raises(ls.SettingsError, match="keyframe"):
        ls.from_urdf(MODELS / "gripper.urdf", keyframe="bent")


def test_plans_say_what_follows(plan):
    assert plan.independent_dofs == ["shoulder_yaw", "shoulder_pitch", "elbow", "knuckle"] == plan.driven_dofs
    leaders, offset = plan.followers["left_tip_joint"]
    assert leaders == (("knuckle", -1.0),) and offset == 0
    assert plan.limits[plan.dof("elbow")] == pytest.approx([-2.2, 1.2])
    assert "reduced" in plan.describe() and plan.nv == len(plan.dof_names) == 9
    assert len(plan.parameter_rows("gear_ratio")) == 5
    with pytest.raises(ls.UsageError):
        plan.dof("nothing")


def test_plans_say_what_stands_in_the_way():
    model = gripper_model()
    with pytest.raises(ls.SettingsError) as refused:
        ls.compile(model, method="pgs", integrator="leapfrog")
    against = [o for o in ls.compile(model, method="pgs").obstacles() if o["applies_to"] == "leapfrog"]
    assert against[0]["feature"] == "sweeps" and against[0]["remedy"] == refused.value.remedy
    assert refused.value.rule.endswith(against[0]["reason"])


def test_a_model_is_written_and_read():
    model = gripper_model()
    model.joints["elbow"].position = 0.25
    made = ls.export_mjcf(model, timestep=1 / 500)
    assert 'timestep="0.002"' in made.text
    assert any("velocity limits, left out" in line for line in made.warnings)
    assert set(made.warnings) < set(made.report)
    again = ls.from_mjcf_text(made.text, keyframe="start")
    assert again.joints["elbow"].position == 0.25
    assert again.joints["knuckle"].drive.kp == model.joints["knuckle"].drive.kp
    assert ls.from_urdf_text(ls.export_urdf(model).text).couplings == model.couplings
    with pytest.raises(ls.SettingsError):
        ls.export_mjcf(model, timestep=0.0)
