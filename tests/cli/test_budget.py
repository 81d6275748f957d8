# SPDX-License-Identifier: MIT
"""postproc/budget.py: variance components and shares of models with known ones, distributions of the Latin hypercube,
and a study end to end."""
import json
import re
import subprocess

import h5py
import numpy as np
import pytest
from scipy import stats

import made_up_ensemble as made_up
from harness import BERGTOW, ROOT, TOW, call, changed, environment, script, write_case

from bergtow import cli
from bergtow.errors import RunError
from bergtow.reporting import method
from bergtow.result import answers, compared
from bergtow.result.members import Members
from bergtow.result.run import Run, parse_case
from bergtow.stats import load as stat_load
from bergtow.stats import variance as stat_budget
from bergtow.study import analysis, budget
from bergtow.table import written
from bergtow.text import budget as budget_text
from bergtow.writing import plain
from test_loads import SERIES


def latin(n, k, rng):
    return (np.array([rng.permutation(n) for _ in range(k)]).T + rng.random((n, k))) / n


def drawn(model, n, k, repeats, noise, rng, names="abcdefgh"):
    """(parameters, condition, y) of a hypercube; model(u [n, k]) -> [n]."""
    u = latin(n, k, rng)
    y = np.repeat(model(u), repeats) + noise * rng.standard_normal(n * repeats)
    return {names[j]: np.repeat(u[:, j], repeats) for j in range(k)}, np.repeat(np.arange(n), repeats), y


# ---- known answers


def test_a_linear_model_with_noise():
    """y = 10 + sum c u + noise: variances c²/12 and the noise's."""
    c, noise = np.array([6.0, 3.0, 1.0]), 1.0
    truth, rng = np.sum(c * c) / 12, np.random.default_rng(1)
    found = stat_budget.budget(*drawn(lambda u: 10 + u @ c, 400, 3, 3, noise, rng))
    assert found["mean"] == pytest.approx(15, abs=0.1) and found["fields"]["sd"] == pytest.approx(noise, rel=0.06)
    assert found["parameters"]["sd"] == pytest.approx(np.sqrt(truth), rel=0.05)
    assert found["fields"]["share"] == pytest.approx(noise ** 2 / (noise ** 2 + truth), abs=0.03)
    first = [i["first"] for i in found["shares"]["indices"].values()]
    assert first == pytest.approx(c * c / np.sum(c * c), abs=0.03)


def test_intervals_hold_the_variances():
    c, noise, rng = np.array([3.0, 2.0]), 1.0, np.random.default_rng(2)
    truth = {"fields": noise, "parameters": np.sqrt(np.sum(c * c) / 12)}
    inside = {"fields": 0, "parameters": 0, "mean": 0}
    for _ in range(200):
        parameters, condition, y = drawn(lambda u: 10 + u @ c, 24, 2, 2, noise, rng)
        groups = np.split(y, 24)
        whole = stat_budget.parts(groups)
        without = [stat_budget.parts(groups[:i] + groups[i + 1:]) for i in range(24)]
        for name, value in truth.items():
            low, high = stat_load.jackknife(getattr(whole, name), [getattr(p, name) for p in without],
                                            scale=stat_load.LOG)
            inside[name] += low <= value ** 2 <= high
        low, high = stat_load.jackknife(whole.mean, [p.mean for p in without])
        inside["mean"] += low <= 10 + c.sum() / 2 <= high
    assert all(0.9 <= n / 200 <= 1.0 for n in inside.values()), inside


@pytest.mark.slow
def test_ishigami_through_the_ensemble(tmp_path):
    """Ishigami & Homma 1990 with noise, in the file of an ensemble, by the code that reads one."""
    a, b, pi, rng = 7.0, 0.1, np.pi, np.random.default_rng(3)
    def model(u):
        x = pi * (2 * u - 1)
        return 100 + np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])
    parameters, condition, y = drawn(model, 300, 3, 2, 0.5, rng)
    members = [made_up.member(np.full(3, v), {k: p[i] for k, p in parameters.items()}, int(condition[i]))
               for i, v in enumerate(y)]
    found = budget.of_ensemble(Members(made_up.write(tmp_path / "e", members, sampling="latin-hypercube")))
    v1, v2, v13 = 0.5 * (1 + b * pi ** 4 / 5) ** 2, a * a / 8, b * b * pi ** 8 * (1 / 18 - 1 / 50)
    total = v1 + v2 + v13
    assert found["parameters"]["sd"] == pytest.approx(np.sqrt(total), rel=0.08)
    assert found["fields"]["sd"] == pytest.approx(0.5, rel=0.1)
    i = found["shares"]["indices"]
    assert [i[k]["first"] for k in "abc"] == pytest.approx(np.array([v1, v2, 0]) / total, abs=0.05)
    assert [i[k]["total"] for k in "abc"] == pytest.approx(np.array([v1 + v13, v2, v13]) / total, abs=0.05)
    assert found["shares"]["q2"] > 0.85 and "rough guide" not in budget_text.notes(plain(found))


def test_what_cannot_be_predicted_is_not_shared_out():
    rng = np.random.default_rng(4)
    steps = stat_budget.budget(*drawn(lambda u: 5 + np.sign(np.sin(60 * u[:, 0])), 60, 2, 2, 0.1, rng))
    assert "refused" in steps["shares"] and steps["parameters"]["sd"] == pytest.approx(1, rel=0.1)
    nothing = stat_budget.budget(*drawn(lambda u: 5 + 0 * u[:, 0], 60, 2, 2, 1.0, rng))
    assert nothing["parameters"]["share"] < 0.3 and nothing["parameters"]["sd_95"][0] == 0
    once = stat_budget.budget(*drawn(lambda u: 5 + u[:, 0], 60, 2, 1, 1.0, rng))
    assert np.isnan(once["fields"]["sd"]) and once["parameters"]["sd"] == pytest.approx(np.sqrt(1 + 1 / 12), rel=0.25)
    assert "needs 8" in stat_budget.budget({"a": np.arange(3)}, np.arange(3), np.ones(3))["refused"]


def test_a_response_of_many_scales_is_shared_out_on_its_logarithm():
    rng = np.random.default_rng(5)
    found = stat_budget.budget(*drawn(lambda u: np.exp(4 * u[:, 0] + 3 * u[:, 1]), 60, 2, 2, 0.0, rng))
    assert found["shares"]["scale"] == "its logarithm" and found["shares"]["q2"] > 0.99
    assert found["shares"]["indices"]["a"]["first"] == pytest.approx(16 / 25, abs=0.05)


ROWS = [{"name": "dt", "judged": "matters", "effect": -0.3, "interval_95": [-0.35, -0.25], "from": 2.0, "to": 1.0},
        {"name": "dt", "judged": "none", "effect": 0.0, "interval_95": [-0.04, 0.02], "from": 1.0, "to": 0.5},
        {"name": "width", "judged": "none", "effect": 0.0, "interval_95": [-0.03, 0.06], "from": 10.0, "to": 20.0},
        {"name": "start", "judged": "matters", "effect": 1.5, "interval_95": [1.0, 2.0], "from": 1.0, "to": 4.0},
        {"name": "fields", "judged": "none"}]
LEFT = {"length": "not varied", "tolerance": "not varied", "window": "not varied"}


def test_numerics_begin_at_the_value_of_the_study():
    """Of what was compared at finer values only what lies beyond counts, and of a coarser one nothing is known."""
    def found(rows=ROWS, **own):
        return stat_budget.relative_numerics(rows, {"width": 10.0, **own})
    assert found(dt=1.0) == {"sd": pytest.approx(np.hypot(0.02, 0.03)), "biases": {}, "unknown": LEFT, "within": []}
    coarse = found(dt=2.0)
    assert coarse["biases"] == {"dt": pytest.approx(-0.3)} and coarse["unknown"] == LEFT
    assert coarse["sd"] == pytest.approx(np.sqrt(0.025 ** 2 + (0.7 * 0.02) ** 2 + 0.03 ** 2))
    for dt in (0.5, 3.0, None):
        other = found(dt=dt)
        assert other["unknown"] == {"dt": "not compared at the value of this study"} | LEFT
        assert other["sd"] == pytest.approx(0.03)
    still = found(ROWS[:1], dt=2.0, width=None)
    assert still["unknown"]["dt"] == "matters up to the last value compared" and still["biases"]
    assert still["within"] == ["dt"]
    spent = found([{"name": "dt", "judged": "open", "interval_95": [None, None], "from": 2.0, "to": 1.0}], dt=2.0)
    assert spent["unknown"]["dt"] == "not resolved" and np.isnan(spent["sd"]) and spent["within"] == []
    assert stat_budget.relative_numerics([], {}) is None


def test_a_window_fits_where_both_of_its_ends_do():
    rows = [{"name": "window", "judged": "none", "interval_95": [-0.02, 0.04], "from": 600.0, "to": 2100.0}]
    def sd(start, end):
        return stat_budget.relative_numerics(rows, {"window": (start, end)})["sd"]
    assert sd(600.0, 3600.0) == sd(605.0, 3600.0) == pytest.approx(0.02)
    assert np.isnan([sd(700.0, 3600.0), sd(600.0, 7200.0)]).all()


def said_of(rows, own, rng):
    made = drawn(lambda u: 10 + u[:, 0], 40, 1, 2, 0.3, rng)
    found = stat_budget.budget(*made, stat_budget.relative_numerics(rows, own) if own else rows) | {
        "units": "N", "of": "mean_ice_resistance_n", "meaning": "mean", "wanted": 80, "title": "t",
        "assumed": {"a": {"distribution": "uniform", "source": ""}}}
    budget_text.figure(plain(found))
    return found, written(budget_text.content(plain(found)))


def test_a_bias_is_named_and_nothing_is_at_most_that_is_not():
    """The budget of a study at a time step that matters by -30 % is mostly that, and says what nobody resolved."""
    rng = np.random.default_rng(6)
    found, text = said_of(ROWS, {"dt": 2.0, "width": 40.0}, rng)
    n = found["numerics"]
    assert n["bias"] == pytest.approx(-0.3 * found["mean"]) and n["bias_share"] > 0.9
    shares = [found[part]["share"] for part in ("fields", "parameters", "numerics")]
    assert sum(shares) + n["bias_share"] == pytest.approx(1)
    assert found["together"]["sd"] > abs(n["bias"]) and "bias of dt" in text and "dt by -30 %" in text
    assert "at most" not in text and "width (not compared at the value of this study)" in text
    assert "length (not varied)" in text
    every = ROWS + [{"name": name, "judged": "none", "interval_95": [-0.01, 0.01], "from": 1.0, "to": 2.0}
                    for name in ("length", "tolerance")]
    every += [{"name": "window", "judged": "none", "interval_95": [-0.01, 0.01], "from": 10.0, "to": 20.0}]
    own = {"dt": 1.0, "width": 10.0, "length": 1.0, "tolerance": 1.0, "window": (10.0, 30.0)}
    found, text = said_of(every, own, rng)
    assert "at most" in text and "bias" not in text and "without" not in text and "bias_share" not in found["numerics"]
    every[-2] |= {"judged": "open", "why": "the budget is spent", "interval_95": [-0.3, 0.6]}  # tolerance
    found, text = said_of(every, own, rng)
    assert "at most" not in text and "so far of tolerance (the budget is spent)" in text and "without" not in text
    assert found["numerics"]["sd"] == pytest.approx(found["mean"] * np.sqrt(
        0.02 ** 2 + 0.03 ** 2 + 0.005 ** 2 + 0.3 ** 2 + 0.005 ** 2))  # the larger end of the interval is in it
    nothing, text = said_of(ROWS, {"width": 40.0}, rng)
    assert np.isnan([nothing["numerics"]["sd"], nothing["numerics"]["share"]]).all() and "not known" in text
    refused, text = said_of({"refused": "converge.json is of another case, ice.size is 1 m there and 2 m here"}, None,
                            rng)
    assert "not known" in text and "ice.size is 1 m there" in text and "share" not in refused["numerics"]


def test_shares_of_a_mean_of_zero_are_unknown():
    """Such as stalled windows of tows that never stall."""
    found = stat_budget.budget(*drawn(lambda u: 0 * u[:, 0], 40, 1, 2, 0.0, np.random.default_rng(6)),
                               stat_budget.relative_numerics(ROWS, {"dt": 2.0, "width": 40.0})) | {
        "units": "", "of": "stalled_windows", "meaning": "stalled windows", "wanted": 80, "title": "t",
        "assumed": {"a": {"distribution": "uniform", "source": ""}}}
    text = written(budget_text.content(plain(found)))
    assert re.search(r"^together +0 +–", text, re.M)
    budget_text.figure(plain(found))
    assert method.beyond({"budget": plain(found)}, None)[0][1] == "– of the stalled windows"


def test_converge_of_another_case_does_not_fit():
    """A key that no member has so; not one of the computation. Of a key that is varied, a value between those of the
    members fits, and is named where it is one of several."""
    texts = [{"ice.size": "2 m", "ice.friction": f"{f}", "run.dt": "1 s", "ice.field": "/a/field.h5",
              "ice.shape": ("voronoi", "rectangles")[f - 1], "lead.mode": "none"} for f in (1, 2)]
    def why(**values):
        return compared.misfit({"values": texts[0] | {k.replace("__", "."): v for k, v in values.items()}}, texts, {})
    assert why() == why(ice__friction="1.5", run__dt="5 s", ice__field="/b/field.h5") == ""
    assert compared.misfit({}, texts, {}) == ""
    assert why(ice__friction="9") == "ice.friction is 9 there and of 2 other values here"
    assert why(ice__shape="polygons") == "ice.shape is polygons there and of 2 other values here"
    assert why(lead__mode="channel") == "lead.mode is channel there and none here"
    assert compared.alone({"values": texts[1]}, texts) == "ice.friction 2, ice.shape rectangles"
    assert compared.alone({"values": texts[1]}, texts[1:]) == compared.alone({}, texts) == ""
    assert why(ice__size="3 m") == "ice.size is 3 m there and 2 m here"
    assert why(ice__field="other.h5") == "ice.field is other.h5 there and /a/field.h5 here"


def test_the_extent_of_no_lead_is_no_other_case():
    """It follows from the tow. Red: converge.json of a shorter run is refused for lead.length."""
    def texts(mode, length):
        return {"ice.size": "2 m", "lead.mode": mode, "lead.length": length}
    short, long = texts("none", "500 m"), texts("none", "600 m")
    assert compared.misfit({"values": short}, [long], {}) == compared.alone({"values": short}, [long]) == ""
    assert list(compared.unlike(short, long)) == []
    short, long = texts("channel", "500 m"), texts("channel", "600 m")
    assert compared.misfit({"values": short}, [long], {}) == "lead.length is 500 m there and 600 m here"
    assert compared.alone({"values": short}, [long]) == "lead.length 500 m"
    assert list(compared.unlike(short, long)) == [("lead.length", "500 m", "600 m")]


def test_the_file_that_is_named_is_read(tmp_path):
    """Red: that beside it was, whatever the name."""
    for name, title in (("converge", "OTHER"), ("converge-80", "NAMED")):
        (tmp_path / f"{name}.json").write_text(json.dumps({"rows": [], "title": title}))
    assert budget.read_converge(tmp_path / "converge-80.json", tmp_path)["title"] == "NAMED"
    assert budget.read_converge(tmp_path, tmp_path)["title"] == "OTHER"
    for wrong in ("no-such.json", "nowhere"):
        with pytest.raises(RunError, match="is not a converge.json"):
            budget.read_converge(tmp_path / wrong, tmp_path)


# ---- studies with gaps


def with_status(folder, status, n=20, **more):
    """A hypercube of n conditions and two fields, whose member of condition c and repeat r has status(c, r)."""
    rng = np.random.default_rng(8)
    members = [made_up.member(np.full(3, 100.0 + 5 * c + rng.normal()), {"ice.friction": (c + 0.5) / n}, c,
                              status=status(c, r), reason="it diverged" if status(c, r) == made_up.FAILED else "",
                              **(more if c == 3 else {}))
               for c in range(n) for r in range(2)]
    return made_up.write(folder, members, sampling="latin-hypercube")


def test_a_study_that_is_cut_short_is_taken_as_far_as_it_is_a_fair_sample(tmp_path):
    """Of each repeat the conditions before the first gap: those beyond are done because they take less time."""
    e = Members(with_status(tmp_path / "a", lambda c, r: r == 0 or c < 10 or c == 15))
    found = budget.of_ensemble(e)
    assert (found["members"], found["conditions"], found["waiting"], found["left_out"]) == (30, 20, 9, 1)
    assert np.isfinite(found["mean_95"]).all()
    said = written(budget_text.content(plain(found | {"numerics": None})))
    assert said.startswith("WARNING: 9 of 40 members are still to come") and "not used yet: 1 after" in said
    with pytest.raises(RunError, match="too few members for a budget: 0 conditions, needs 8"):
        budget.of_ensemble(Members(with_status(tmp_path / "b", lambda c, r: r == 0 and c >= 8)))


def test_tows_with_doubts_are_counted(tmp_path):
    found = budget.of_ensemble(Members(with_status(tmp_path / "a", lambda c, r: made_up.FINISHED,
                                                    window={"n_contact_stretches": 2.0})))
    assert found["doubts"] == {"few": 2}
    said = written(budget_text.content(plain(found | {"numerics": None})))
    assert "WARNING: 2 of 40 tows carry warnings and are in the numbers (2 few;" in said


def test_members_that_failed_leave_no_interval(tmp_path, monkeypatch, capsys):
    """What made them fail may be what is asked for. They are named, and no script takes the rest for the whole."""
    failing = {(18, 0), (19, 1)}
    folder = with_status(tmp_path / "a", lambda c, r: made_up.FAILED if (c, r) in failing else made_up.FINISHED)
    monkeypatch.setattr(budget, "run_members", lambda *a: (False, []))
    (tmp_path / "study.yml").write_text("")
    with pytest.raises(RunError, match=r"2 of 40 members failed \(c019-r001, c020-r002\)"):
        cli.perform("budget", tmp_path / "study.yml", "-o", folder)
    found, said = json.loads((folder / "budget.json").read_text()), capsys.readouterr().out
    assert found["mean_95"] == found["fields"]["sd_95"] == [None, None] and found["mean"] > 0
    assert "WARNING: 2 of 40 members failed (c019-r001, c020-r002; c019-r001: it diverged)" in said


def test_a_study_without_a_member_that_finished_says_why(tmp_path):
    e = Members(with_status(tmp_path / "a", lambda c, r: made_up.FAILED))
    why = "no member that has finished; 40 failed, the first: c001-r001: it diverged"
    with pytest.raises(RunError, match=why) as error:
        budget.numbers(e, "n_floes")
    assert error.value.status == 4


def loaded(folder, parted=None):
    """A hypercube with a tow force three times the ice resistance, and the force of a floe; the line of member `parted`
    parts at 200 s."""
    rng, members = np.random.default_rng(8), []
    for i in range(20):
        x, event = 100.0 + 5 * i + rng.random(400), [{"kind": "adrift", "time_s": 200, "subject": 0, "value": 0}]
        x[200:] -= 90 * (i == parted)
        more = {"tow_force": 3 * x, "ice_resistance": x, "largest_quasi_static_load": 50 * rng.random(400),
                "impact_peak": 90 * rng.random(400)}
        members.append(made_up.member(x, {"ice.friction": (i // 2 + 0.5) / 10}, i // 2, more=more, attributes=SERIES,
                                      summary={"mean_tow_force_n": 3 * x.mean(), "events": event * (i == parted)}))
    return Members(made_up.write(folder, members, sampling="latin-hypercube"))


def test_numbers_are_those_of_the_loads_and_the_computation_that_of_the_ice_resistance(tmp_path):
    """The force of one floe is not filtered, as it is not in the statistics; per cent of the ice resistance are none of
    a tow force."""
    e = loaded(tmp_path / "a")
    known = {"sd": 0.01, "biases": {"dt": -0.3}, "unknown": {}}
    found = budget.of_ensemble(e, "floe_force:99")
    assert found["mean"] == pytest.approx(np.mean([np.percentile(np.maximum(*(
        Run(e.folder(m))[name] for name in ("largest_quasi_static_load", "impact_peak"))), 99) for m in range(20)]))
    assert "moving mean" not in found["meaning"] and "is by half-sine of 0.1 s" in found["meaning"]
    assert budget.of_ensemble(e, computed=known)["numerics"]["bias"] < -0.3
    other = budget.of_ensemble(e, "mean_tow_force_n", known)
    assert other["numerics"] is None
    assert "knows only what the computation adds to the mean ice resistance" in budget_text.notes(plain(other))


def test_what_comes_after_a_line_parted_is_in_no_budget(tmp_path):
    e = loaded(tmp_path / "a", parted=3)
    with pytest.raises(RunError, match="has no tow force: the line parted in 1 of 20 tows"):
        budget.of_ensemble(e, "tow_force:99")
    assert budget.of_ensemble(e)["mean"] == pytest.approx(148, rel=0.01)
    cut = budget.of_ensemble(e, "mean_tow_force_n")
    assert cut["without_number"] == ["c002-r002"] and np.isnan(cut["mean_95"]).all()


def test_a_failed_member_that_is_not_in_the_sample_takes_no_interval_from_it(tmp_path):
    """It is named all the same."""
    status = {(10, 0): made_up.WAITING, (15, 0): made_up.FAILED}
    found = budget.of_ensemble(Members(with_status(tmp_path / "a", lambda c, r: status.get((c, r), made_up.FINISHED))))
    assert np.isfinite([*found["mean_95"], *found["fields"]["sd_95"]]).all()
    assert list(found["failed"]) == found["failed_beyond"] == ["c016-r001"]
    said = written(budget_text.content(plain(found | {"numerics": None})))
    assert "c016-r001: it diverged). They lie after the first unfinished" in said and "no intervals" not in said


def test_a_budget_knows_of_which_state_of_the_study_it_is(tmp_path):
    whole = Members(with_status(tmp_path / "a", lambda c, r: 1))
    cut = Members(with_status(tmp_path / "b", lambda c, r: r == 0 or c < 10))
    found = plain(budget.of_all(cut, ["mean_ice_resistance_n"], None))
    assert compared.stale(found, cut) == "" == compared.stale({}, cut)
    assert compared.stale(found, whole) == "of 30 members, while 40 have finished"
    assert compared.stale(compared.state(whole), cut) == "of 40 members, while 30 have finished"
    whole.study += "another"
    assert compared.stale(found, whole) == "of a different study from that in its folder"
    assert found["values"] == {"ice.concentration": "0.5"}
    assert compared.common([{"a": "1", "b": "2"}, {"a": "1", "b": "3"}]) == {"a": "1"}


# ---- the sampler


STUDY = {
    "base": "base.yml", "sampling": "latin-hypercube", "samples": 12, "repeats": 2,
    "parameters": {
        "ice.friction": {"from": 0.1, "to": 0.5, "distribution": "triangular", "source": "a book, p. 3"},
        "ice.thickness": {"from": "2 cm", "to": "6 cm", "distribution": "normal"},
        "body.draft": {"from": 0.3, "to": 0.6, "distribution": "normal", "scale": "log"},
        "ice.density": {"from": 850, "to": 920}
    }
}
BASE = changed(TOW, run__duration=8, output__window_start=2, domain__length=8, domain__width=5,
               estimate__length_scale=900)  # a time scale of 1 s


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("budget")
    write_case(folder, BASE, "base.yml")
    write_case(folder, STUDY, "study.yml")
    done = script("budget", "study.yml", "-o", "out", "--budget", "3", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_every_stratum_of_each_distribution_holds_one_value(small):
    """The distribution function of SciPy takes the values of a hypercube to one in each n-th part of (0, 1)."""
    cut = 2 * stats.norm.cdf(3) - 1
    def normal(lo, hi, x):
        return (stats.norm.cdf(x, (lo + hi) / 2, (hi - lo) / 2 / stats.norm.ppf(0.975)) - stats.norm.cdf(-3)) / cut
    below = {
        "ice.friction": lambda x: stats.triang.cdf(x, 0.5, 0.1, 0.4), "ice.thickness": lambda x: normal(0.02, 0.06, x),
        "body.draft": lambda x: normal(np.log(0.3), np.log(0.6), np.log(x)),
        "ice.density": lambda x: stats.uniform.cdf(x, 850, 70)
    }
    with h5py.File(small[0] / "out/ensemble.h5") as f:
        for key, function in below.items():
            x = f[f"parameters/{key}"][::2]
            assert np.array_equal(f[f"parameters/{key}"][1::2], x)
            assert sorted(np.floor(12 * function(x) + 1e-9).astype(int).tolist()) == list(range(12)), key
        attributes = dict(f["parameters/ice.friction"].attrs)
    assert attributes["source"] in ("a book, p. 3", b"a book, p. 3") and b"triangular from 0.1 to 0.5" in np.bytes_(
        attributes["distribution"])


def test_the_base_case_may_lie_at_the_end_of_a_range(small, tmp_path):
    """No member of a hypercube does; a key that follows the one varied is there, too. Red: converge.json "of another
    case", and the remedy to run converge on the base case."""
    study = STUDY | {"samples": 8, "repeats": 1, "parameters": {"ice.friction": {"from": 0.1, "to": 0.5}}}
    write_case(tmp_path, changed(BASE, ice__friction=0.1), "base.yml")
    write_case(tmp_path, study, "study.yml")
    assert call("ensemble", "study.yml", "-o", "out", "--quiet", cwd=tmp_path).returncode == 0
    base = parse_case(call("check", "base.yml", "--scale", "1", cwd=tmp_path).stdout)
    e = Members(tmp_path / "out")
    texts = compared.cases(e)
    def refused(**values):
        found = {"rows": [], "values": base | {k.replace("__", "."): v for k, v in values.items()}}
        return "refused" in (budget.numerics(e, found, texts) or {})
    assert base["ice.friction"] == base["body.friction"] == "0.1" and not refused()
    assert refused(ice__friction="0.09") and refused(ice__size="9 m") and not refused(ice__friction="0.3")
    assert Members(small[0] / "out").base["ice.thickness"] and not refused(body__friction="0.3")


def test_a_base_case_outside_the_ranges_is_another_case(tmp_path):
    """Red: the numerical error of a slow tow in much ice was that of a study of fast ones in little."""
    write_case(tmp_path, changed(BASE, tow__speed=0.06, ice__concentration=0.5, ice__friction=0.1), "base.yml")
    def study(friction, **more):
        write_case(tmp_path, {"base": "base.yml", "sampling": "latin-hypercube", "samples": 8, "parameters": {
            "ice.friction": {"from": friction, "to": 0.5}} | more}, "study.yml")
        out = tmp_path / f"{friction}-{len(more)}"
        assert call("ensemble", "study.yml", "-o", out, "--quiet", cwd=tmp_path).returncode == 0
        e = Members(out)
        return lambda values: compared.misfit({"values": base | values}, compared.cases(e), e.base)
    base = parse_case(call("check", "base.yml", "--scale", "1", cwd=tmp_path).stdout)
    friction, faster = study(0.2), study(0.1, **{"tow.speed": {"from": 0.12, "to": 0.16}})
    assert "friction is 0.1 there" in friction({}) and not friction({"ice.friction": "0.3", "body.friction": "0.3"})
    assert faster({}).startswith("tow.speed is 0.06 m/s there") and not faster({"tow.speed": "0.14 m/s"})


@pytest.mark.slow
def test_a_study_end_to_end(small):
    folder, text = small
    found = json.loads((folder / "out/budget.json").read_text())
    assert found["members"] == found["wanted"] == 24 and found["conditions"] == 12
    assert "a book, p. 3" in text and "log-normal, 95 % from 0.3 to 0.6 m; assumed" in text and "not studied" in text
    with h5py.File(folder / "out/ensemble.h5") as f:
        y = f["summary/mean_ice_resistance_n"][()]
    pairs = y.reshape(12, 2)
    assert found["mean"] == pytest.approx(y.mean())
    assert found["fields"]["sd"] ** 2 == pytest.approx(np.mean(np.var(pairs, axis=1, ddof=1)))
    assert (folder / "out/budget.png").stat().st_size > 15_000
    tail, largest = found["more"]
    assert [tail["of"], largest["of"]] == ["tow_force:99", "tow_force:100"]
    assert "tow force that 1 % of the time exceeds, as the moving mean over 1 s" in text
    levels, most = [], []
    for member in sorted((folder / "out/members").iterdir()):
        with h5py.File(member / "result.h5") as f:
            t, x = f["series/time"][:], f["series/tow_force"][:]
        n = round(1 / (t[1] - t[0]))
        some = x[t >= json.loads((member / "summary.json").read_text())["window"]["start_s"] - 1e-9]
        means = np.convolve(some, np.full(n, 1 / n), "valid")
        levels.append(np.percentile(means, 99))
        most.append(means.max())
    assert len(levels) == 24 and tail["mean"] == pytest.approx(np.mean(levels), rel=1e-9)
    assert tail["fields"]["sd"] ** 2 == pytest.approx(np.mean(np.var(np.reshape(levels, (12, 2)), axis=1, ddof=1)))
    assert largest["mean"] == pytest.approx(np.mean(most), rel=1e-9) and largest["mean"] > tail["mean"]
    seconds = json.loads((member / "summary.json").read_text())["window"]
    minutes = f"{(seconds['end_s'] - seconds['start_s']) / 60:.3g} min"
    assert f"largest tow force of a tow, within {minutes}, as the moving mean over 1 s" in text
    block = analysis.chapter("budget", answers.read("budget", folder / "out"))
    assert "\n| part |" in written(block["parts"], True) and len(block["figure"]().axes) == 2
    case = Run(member).case
    row = {"name": "dt", "judged": "none", "interval_95": [-0.1, 0.2], "from": float(case["run.dt"].split()[0])}
    def with_it(row, values):
        (folder / "converge.json").write_text(json.dumps({"rows": [row], "values": values}))
        again = script("budget", "study.yml", "-o", "out", "--converge", "converge.json", cwd=folder)
        assert again.returncode == 0, again.stderr
        return again.stdout, json.loads((folder / "out/budget.json").read_text())["numerics"]
    said, numerics = with_it(row, case)
    assert set(numerics["unknown"]) == set(stat_budget.QUANTITIES) - {"dt"} and not numerics["within"]
    assert all(name in said.partition("Numerics without ")[2] for name in numerics["unknown"])
    assert numerics["sd"] == pytest.approx(0.1 * abs(y.mean()))
    said, numerics = with_it(row | {"from": 2 * row["from"]}, case)
    assert "dt (not compared at the value of this study)" in said and numerics["sd"] is None
    said, numerics = with_it(row, case | {"ice.size": "77 m"})
    assert "of another case, ice.size is 77 m there" in numerics["refused"] and numerics["refused"] in said


@pytest.mark.parametrize("keys, words", [
    ({"sampling": "grid"}, "is not a Latin hypercube"), ({"fields": "common"}, "has common fields"),
    ({"samples": 7}, "has 7 samples, too few for a budget; take 8 or more")])
def test_a_study_without_a_budget_is_refused_before_its_members_run(tmp_path, keys, words):
    write_case(tmp_path, BASE, "base.yml")
    study = STUDY | keys
    if "sampling" in keys:
        study = {"base": "base.yml", "parameters": {"ice.friction": [0.1, 0.5]}}
    write_case(tmp_path, study, "study.yml")
    done = script("budget", "study.yml", "-o", "out", cwd=tmp_path)
    assert done.returncode == 3 and words in done.stderr and not (tmp_path / "out").exists()


@pytest.mark.slow
def test_what_is_refused(small, tmp_path):
    folder, _ = small
    def said(study, *more, out="refused", code=4):
        write_case(tmp_path, BASE, "base.yml")
        write_case(tmp_path, study, "study.yml")
        done = script("budget", "study.yml", "-o", out, *more, cwd=tmp_path)
        assert done.returncode == code and "Traceback" not in done.stderr
        return done.stderr
    def varied(**entry):
        return STUDY | {"parameters": {"ice.friction": {"from": 0.1, "to": 0.5} | entry}}
    assert "ice.friction.distribution: bell: give uniform, triangular or normal" in said(varied(distribution="bell"),
                                                                                     code=3)
    wide = {"from": 0.001, "distribution": "normal"}
    assert "a normal distribution with 95 % from 0.001 to 0.5 reaches: -0.1" in said(varied(**wide), code=3)
    grid = {k: v for k, v in STUDY.items() if k not in ("sampling", "samples")}
    assert "set sampling: latin-hypercube and samples" in said(grid, code=3)
    assert "no such file" in subprocess.run([BERGTOW, "budget", "none.yml"], env=environment(BERGTOW_HOME=ROOT),
                                            cwd=tmp_path, capture_output=True, text=True).stderr
    assert "is not a converge.json" in said(STUDY, "--converge", "nothing.json", out=folder / "out")
    assert "has no number mean_colour" in said(STUDY, "--of", "mean_colour", out=folder / "out", code=2)
    assert "has no load colour" in said(STUDY, "--of", "colour:99", out=folder / "out")
    for wrong in ("tow_force:101", "tow_force:0"):
        assert "above 0 and at most at 100 %" in said(STUDY, "--of", wrong, out=folder / "out", code=2)
    # the folder holds another study: its numbers are no answer to this one
    for study, more in ((STUDY | {"samples": 10}, ()), (STUDY, ("--set", "ice.size=0.8"))):
        assert "another study" in said(study, *more, out=folder / "out", code=3)
    with pytest.raises(RunError, match="is not a Latin hypercube"):
        one = made_up.member(np.ones(3), {"ice.friction": 0.1}, 0)
        budget.of_ensemble(Members(made_up.write(tmp_path / "g", [one])))
