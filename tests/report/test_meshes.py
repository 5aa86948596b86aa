import numpy as np
import pytest

from selfmodel.report.meshes import Triangles, simplified


def sphere(rings: int) -> Triangles:
    """A unit sphere of ``2 rings^2`` squares, each of two triangles."""
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1), indexing="ij"
    )
    vertices = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    )
    first = (np.arange(rings)[:, None] * (2 * rings + 1) + np.arange(2 * rings)).reshape(-1)
    below = first + 2 * rings + 1
    faces = np.concatenate(
        [np.stack([first, below, below + 1], 1), np.stack([first, below + 1, first + 1], 1)]
    )
    return Triangles(vertices.reshape(-1, 3), faces)


def test_a_small_mesh_is_left_as_it_is():
    mesh = sphere(4)

    assert simplified(mesh, 1000) is mesh


@pytest.mark.parametrize("most", [200, 300, 3000])
def test_a_large_mesh_has_at_most_the_triangles_and_about_its_surface(most: int):
    found = simplified(sphere(60), most)

    assert 0 < len(found.faces) <= most
    assert np.all(np.linalg.norm(found.vertices, axis=1) < 1.01)
    assert found.faces.max() < len(found.vertices)
    assert np.linalg.norm(found.vertices, axis=1).min() > 0.85
