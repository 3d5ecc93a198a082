"""Rays into meshes and frames against arithmetic and against a loop over all triangles in f64."""

from __future__ import annotations

import numpy as np
import pytest

import sightline

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
FACES = np.array([half for a, b, c, d in SIDES for half in ([a, b, c], [a, c, d])])


def loop(vertices, faces, rays):
    """Distance, face, weights and number of hits of each ray: Möller and Trumbore over all faces in f64."""
    a, b, c = (vertices[faces[:, k]].astype(float) for k in range(3))
    found = []
    for ray in rays.astype(float):
        across = np.cross(ray[3:], c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / np.einsum("nk,nk->n", b - a, across)
            u = np.einsum("nk,nk->n", ray[:3] - a, across) * inverse
            turned = np.cross(ray[:3] - a, b - a)
            v = turned @ ray[3:] * inverse
            t = np.einsum("nk,nk->n", turned, c - a) * inverse
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & np.isfinite(t)
        t = np.where(hit, t, np.inf)
        at = int(np.argmin(t))
        found.append((t[at], at if hit.any() else -1, u[at], v[at], hit.sum()))
    return tuple(np.array(column) for column in zip(*found))


def test_a_mesh_is_hit_as_arithmetic_says() -> None:
    rng = np.random.default_rng(3)
    vertices = np.concatenate([CUBE * size + rng.uniform(-9, 9, 3) for size in rng.uniform(0.2, 2, 20)]).astype(np.float32)
    faces = np.concatenate([FACES + 8 * k for k in range(20)])
    caster = sightline.Raycaster(vertices, faces, class_ids=np.arange(len(faces)) // 12)
    assert len(caster) == 240 and repr(caster) == "Raycaster(240 triangles)"
    rays = np.hstack([rng.uniform(-12, 12, (3000, 3)), rng.normal(size=(3000, 3))]).astype(np.float32)
    t, face, u, v, count = loop(vertices, faces, rays)
    hits = caster.cast_rays(rays, normals=True, uvs=True)
    hit = face >= 0
    assert 300 < hit.sum() < 2900
    assert (hits["primitive_ids"] == face).all()
    np.testing.assert_allclose(hits["t_hit"], t, rtol=2e-6, atol=1e-5)
    assert (hits["class_ids"] == np.where(hit, face // 12, -1)).all()
    np.testing.assert_allclose(hits["uvs"][hit], np.stack([u, v], 1)[hit], atol=1e-6)
    corners = vertices[faces[face[hit]]].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(hits["normals"][hit], normals / np.linalg.norm(normals, axis=1)[:, None], atol=1e-6)
    assert np.isnan(hits["normals"][~hit]).all() and np.isnan(hits["uvs"][~hit]).all()
    assert (caster.count(rays) == count).all() and (caster.occluded(rays) == hit).all()
    near = t <= 4
    assert (caster.occluded(rays, t_max=4) == near).all() and 100 < near.sum() < hit.sum()
    assert (np.isfinite(caster.cast_rays(rays, t_max=4)["t_hit"]) == near).all()


def test_rays_of_any_shape(small) -> None:
    rays = np.random.default_rng(1).normal(size=(3, 4, 5, 6)) + [0, 0, 2, 0, 0, 0]
    flat = small.cast_rays(rays.reshape(-1, 6), frame=1, normals=True)
    shaped = small.cast_rays(rays, frame=1, normals=True)
    assert shaped["t_hit"].shape == (3, 4, 5) and shaped["normals"].shape == (3, 4, 5, 3)
    assert all(shaped[name].tobytes() == flat[name].tobytes() for name in flat)
    for memory in (np.asfortranarray(rays), np.asfortranarray(rays.astype(np.float32))):
        by_column = small.cast_rays(memory, frame=1)
        assert by_column["primitive_ids"].tobytes() == flat["primitive_ids"].tobytes()
    one = small.cast_rays([0, 0, 1, 1, 0, 0])
    assert one["t_hit"].shape == () and one["t_hit"] == pytest.approx(4.5) and one["primitive_ids"].dtype == np.int64
    assert small.raycaster(1).occluded(rays).shape == (3, 4, 5)
    assert small.cast_rays(np.zeros((0, 6)))["primitive_ids"].shape == (0,)


def test_a_frame_is_the_mesh_of_it(scene) -> None:
    mesh = scene.mesh(3)
    rng = np.random.default_rng(5)
    rays = np.hstack([rng.uniform([-20, -20, 0.5], [20, 20, 4], (4000, 3)), rng.normal(size=(4000, 3))])
    ours = scene.raycaster(3).cast_rays(rays, normals=True)
    whole = sightline.Raycaster(mesh["vertices"], mesh["faces"], class_ids=mesh["class_ids"]).cast_rays(rays, normals=True)
    both = np.isfinite(ours["t_hit"]) & np.isfinite(whole["t_hit"])
    assert both.sum() > 1500 and (np.isfinite(ours["t_hit"]) != np.isfinite(whole["t_hit"])).sum() <= 2
    np.testing.assert_allclose(ours["t_hit"][both], whole["t_hit"][both], rtol=1e-4, atol=1e-3)
    same = both & (ours["primitive_ids"] == whole["primitive_ids"])
    assert same.sum() > 0.95 * both.sum()
    np.testing.assert_allclose(ours["normals"][same], whole["normals"][same], atol=1e-6)
    assert (ours["class_ids"][same] == whole["class_ids"][same]).all()


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: sightline.Raycaster([[0, 0]], [[0, 0, 0]]), r"vertices: has the shape \[1, 2\]"),
        (lambda: sightline.Raycaster(CUBE, [[0, 1, 8]]), r"faces\[0, 2\]: is 8; give a whole number, 0 to 7"),
        (lambda: sightline.Raycaster(CUBE, [0, 1, 2]), r"faces: has the shape \[3\]"),
        (lambda: sightline.Raycaster(CUBE, FACES, class_ids=[1]), "class_ids: has the length 1; give one for each face, 12 in all"),
        (lambda: sightline.Raycaster(np.full((3, 3), np.nan), [[0, 1, 2]]), r"vertices\[0\]: is not finite"),
        (lambda: sightline.Raycaster(CUBE, FACES, reach=-1), "reach: is -1"),
        (lambda: sightline.Raycaster(CUBE, FACES).cast_rays(np.ones((2, 6)), t_max=0), "t_max: is 0"),
        (lambda: sightline.Raycaster(CUBE, FACES).count(np.full((2, 3, 6), np.inf)), r"rays\[0, 0\]: is not finite"),
    ],
)
def test_wrong_rays_and_meshes(call, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        call()
