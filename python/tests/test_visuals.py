# SPDX-License-Identifier: Apache-2.0
"""Visual meshes: read on request, for pages alone."""
import base64
import json
import re

import numpy as np
import pytest

import lockstep as ls

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])

URDF = """<robot name="arm"><link name="base"/>
  <link name="tip"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><origin xyz="0 0 2" rpy="0 0 1.5707963267948966"/>
      <geometry><mesh filename="{file}" scale="0.1 0.1 0.2"/></geometry></visual></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="tip"/></joint></robot>"""

MJCF = """<mujoco><asset><mesh name="m" file="m.stl" scale="0.1 0.1 0.2"/></asset><worldbody><body name="tip">
  <joint name="turn" axis="0 0 1" pos="0 0 0.5"/><inertial mass="1" diaginertia="1 1 1" pos="0 0 0"/>
  <geom type="mesh" mesh="m" pos="0 0 2" {masks}/></body></worldbody></mujoco>"""


def write_stl(path, vertices, faces):
    """Binary."""
    rows = np.zeros(len(faces), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]))
    rows["corners"] = vertices[faces]
    path.write_bytes(b" " * 80 + np.uint32(len(faces)).tobytes() + rows.tobytes())


def sphere(rings):
    """Unit sphere of about 4 rings^2 triangles."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.arange(2 * rings) * np.pi / rings, indexing="ij")
    vertices = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], -1)
    here = np.arange(rings * 2 * rings).reshape(rings, -1)
    right = np.roll(here, -1, axis=1)
    quads = np.stack([here, here + 2 * rings, right + 2 * rings, right], -1).reshape(-1, 4)
    return vertices.reshape(-1, 3).astype(np.float32), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def urdf(tmp_path, file="m.stl"):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF.format(file=file))
    return path


def by_rows(vertices):
    return np.array(sorted(vertices.round(5).tolist())) + 0.0


def test_a_urdf_shows_its_meshes_in_the_frame_of_the_link(tmp_path):
    write_stl(tmp_path / "m.stl", TETRAHEDRON, FACES)
    model = ls.from_urdf(urdf(tmp_path), visual_meshes=True)
    (mesh,) = model.visual_meshes
    assert mesh.link == "tip" and mesh.vertices.dtype == np.float32 and mesh.triangles.shape == (4, 3)
    expected = [[0, 0, 2], [0, 0.1, 2], [-0.1, 0, 2], [0, 0, 2.2]]  # scaled, turned by 90 degrees, moved
    np.testing.assert_allclose(by_rows(mesh.vertices), by_rows(np.array(expected)), atol=1e-5)
    corners = mesh.vertices[mesh.triangles]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", outward, corners.mean(1) - mesh.vertices.mean(0)) > 0).all()
    assert any("visual meshes, for pages alone" in line for line in model.report)
    assert not model.colliders


def test_an_mjcf_shows_geoms_that_touch_nothing_or_all(tmp_path):
    write_stl(tmp_path / "m.stl", TETRAHEDRON, FACES)
    path = tmp_path / "arm.xml"
    path.write_text(MJCF.format(masks='contype="0" conaffinity="0"'))
    (mesh,) = ls.from_mjcf(path, visual_meshes=True).visual_meshes
    # The frame of the link stands at its joint.
    expected = [[0, 0, 1.5], [0.1, 0, 1.5], [0, 0.1, 1.5], [0, 0, 1.7]]
    np.testing.assert_allclose(by_rows(mesh.vertices), by_rows(np.array(expected)), atol=1e-5)
    path.write_text(MJCF.format(masks=""))
    (own,) = ls.from_mjcf(path, visual_meshes=True).visual_meshes
    np.testing.assert_array_equal(own.vertices, mesh.vertices)
    path.write_text(MJCF.format(masks='/><geom type="mesh" mesh="m" contype="0" conaffinity="0"'))
    (own,) = ls.from_mjcf(path, visual_meshes=True).visual_meshes
    np.testing.assert_allclose(own.vertices[:, 2].min(), -0.5, atol=1e-6)  # not that at 2 m


def test_large_meshes_are_simplified(tmp_path):
    vertices, faces = sphere(150)
    write_stl(tmp_path / "m.stl", vertices, faces)
    model = ls.from_urdf(urdf(tmp_path), visual_meshes=True)
    (mesh,) = model.visual_meshes
    assert 5000 < len(mesh.triangles) <= 20000
    assert any("simplified" in line and "tip" in line for line in model.report)
    # It is still the sphere, scaled.
    own = (mesh.vertices - [0, 0, 2]) / [0.1, 0.1, 0.2]
    assert np.abs(np.linalg.norm(own, axis=1) - 1).max() < 0.02
    assert mesh.vertices[:, 2].max() - mesh.vertices[:, 2].min() == pytest.approx(0.4, rel=0.02)


def test_meshes_are_opened_on_request_alone(tmp_path):
    path = urdf(tmp_path, "absent.stl")
    assert not ls.from_urdf(path).visual_meshes
    with pytest.raises(ls.ImportFileError, match="absent.stl', which does not exist"):
        ls.from_urdf(path, visual_meshes=True)
    model = ls.from_urdf(path, visual_meshes=True, leave_out_meshes=True)
    assert not model.visual_meshes and any("left out on request" in line for line in model.warnings)
    model = ls.from_urdf(urdf(tmp_path, "m.dae"), visual_meshes=True)
    assert any("m.dae" in line or "COLLADA" in line for line in model.warnings)


def test_a_page_has_them_in_place_of_solids(tmp_path):
    write_stl(tmp_path / "m.stl", TETRAHEDRON, FACES)
    model = ls.from_urdf(urdf(tmp_path), visual_meshes=True)
    batch = ls.compile(model).batch(1, threads=1)
    recording = ls.Recording(batch, visual_meshes=model.visual_meshes)
    try:
        recording.save(tmp_path / "page.html")
    except ls.UsageError as error:
        pytest.skip(str(error))
    found = re.search(r'type="application/json">(.*?)</script>', (tmp_path / "page.html").read_text())
    (link,) = json.loads(found[1])["links"]
    assert link["name"] == "tip" and link["solids"] == []
    written = np.frombuffer(base64.b64decode(link["meshes"][0]["vertices"]), np.float32).reshape(-1, 3)
    np.testing.assert_array_equal(written, model.visual_meshes[0].vertices)


@pytest.mark.parametrize("vertices, triangles, said", [
    (TETRAHEDRON[:, :2], FACES, "no array"),
    (TETRAHEDRON, FACES[0], "no array"),
    (TETRAHEDRON, FACES + 1, "vertices that it does not have"),
    (TETRAHEDRON, FACES - 1, "vertices that it does not have"),
])
def test_meshes_that_cannot_be_are_refused(tmp_path, vertices, triangles, said):
    batch = ls.compile(ls.from_urdf(urdf(tmp_path))).batch(1, threads=1)
    with pytest.raises(ls.UsageError, match=said):
        ls.Recording(batch, visual_meshes=[ls.VisualMesh("tip", vertices, triangles)])
