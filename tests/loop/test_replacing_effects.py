"""The search ends where effects replace each other without end."""

from types import SimpleNamespace

import pytest

from anglecam.loop import stepwise


def assessment(effect, robust_sigma):
    """Return what the search reads of an assessment whose fit has one effect."""
    fit = (SimpleNamespace(id=effect),) if effect else ()
    return SimpleNamespace(fit=fit, cross_validated=SimpleNamespace(robust_sigma=robust_sigma))


@pytest.mark.parametrize(("sigma_of_spring", "sigma_of_gravity", "best"), [(1.0, 2.0, "spring"), (2.0, 1.0, "gravity")])
def test_a_circle_of_effects_ends_at_the_best_of_them(monkeypatch, sigma_of_spring, sigma_of_gravity, best):
    base = assessment(None, 9.0)
    spring, gravity = assessment("spring", sigma_of_spring), assessment("gravity", sigma_of_gravity)
    follower = {None: spring, "spring": gravity, "gravity": spring}

    def id_of(one):
        return one.fit[0].id if one.fit else None

    monkeypatch.setattr(stepwise, "effects_of", lambda fit: fit)
    monkeypatch.setattr(stepwise, "smallest_structure", lambda task, first: 0.0)
    monkeypatch.setattr(stepwise, "smallest_first_effect", lambda task, first, fit: 0.0)
    monkeypatch.setattr(stepwise, "_significant", lambda task, now, candidates, least: True)
    monkeypatch.setattr(stepwise, "sizes_determined", lambda fit, records, policy: True)
    monkeypatch.setattr(stepwise, "_add", lambda task, candidate: candidate)
    monkeypatch.setattr(stepwise, "_next", lambda task, added, least: (added, [follower[id_of(added)]]))
    task = SimpleNamespace(policy=SimpleNamespace(stepwise=SimpleNamespace(most_effects=4)), fitted=())
    assert id_of(stepwise.add_effects(task, base, base, [spring])) == best
