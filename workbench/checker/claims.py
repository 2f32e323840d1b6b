"""What a certificate may claim (the docstrings of `spread` and `tube`), and what shows it."""

import itertools  # noqa: I001
from collections.abc import Iterator, Sequence
from operator import add, sub
from typing import Any

from workbench.checker.arithmetic import ONE, ZERO, Interval, Matrix, Vector
from workbench.checker.arithmetic import apply, dot, grown, positive, product, require
from workbench.checker.model import Graph, expect, parse, read

FORMAT, _MOST_WORK, _CORNER_ENTRIES = "workbench certificate 1", 3e8, 6  # work: about 1e-6 s


def check(data: bytes) -> str:
    """The statement that a file proves; ValueError: no certificate, UnprovedError: not proved."""
    lists: Any = {"states": [str, None], "inputs": [str, None], "nodes": [object, None]}
    form = {"format": str, "statement": str, "kind": str, "claim": object, "proof": object}
    try:
        file = read(parse(data), form | {"model": lists | {"field": object}}, "the file")
        model, kinds = file["model"], {"spread": spread, "tube": tube}
        expect(file["format"] == FORMAT and file["kind"] in kinds, "kind: expected spread or tube")
        kind = kinds[file["kind"]]
        shown = " ".join((kind.__doc__ or "").split()) or None
        expect(file["statement"] == shown, "it states something else (altered, or another version)")
        n, m = len(model["states"]), len(model["inputs"])
        expect(len({*model["states"], *model["inputs"]}) == n + m, "model: a name occurs twice")
        expect(0 < n <= n + m <= 60 and len(model["nodes"]) <= 3000, "model: too large")
        kind(Graph(model["nodes"], model["field"], n, m), file["claim"], file["proof"])
    except (LookupError, ArithmeticError, TypeError, RecursionError) as error:
        raise ValueError(f"the file does not fit together: {error!r}") from None
    return str(shown)


def spread(graph: Graph, claim: Any, proof: Any) -> None:
    """Let x, y solve the model with measurable inputs u, v in `ranges`, |u_j - v_j| <=
    differences_j, and stay in `region` (null: unrestricted) for 0 <= t <= horizon_s. Then N(t) <=
    exp(C t) N(0) + integral of exp(C s) M over [0, t], where C has the rows `comparison`, N_k is
    max P_ii |e_i| (max), sum P_ii |e_i| (sum) or sqrt(e' P e) (quadratic), P = `metric`, for e =
    x - y in block k, and M_k is the largest N_k of any e with |e_i| <= mismatch_i. So |e_i(0)| <=
    initial_i gives |e_i| <= widths_i at `instants`."""
    n, m = graph.n, graph.m
    claim = read(claim, {
        "region": [Interval, n], "ranges": [Interval, m], "differences": [float, m],
        "horizon_s": float, "norm": str, "blocks": [object, None], "mismatch": [float, n],
        "initial": [float, n], "instants": [{"time_s": float, "widths": [float, n]}, None],
    }, "claim")  # fmt: skip
    form = {"states": [int, None], "metric": object, "comparison": [float, len(claim["blocks"])]}
    blocks = claim["blocks"] = read(claim["blocks"], [form, None], "claim.blocks")
    splits = read(proof, {"splits": [{"?": {"axis": int, "at": float}}, None]}, "proof")["splits"]
    norm, owned = claim["norm"], sorted(i for b in blocks for i in b["states"])
    ends = zip(graph.units, [ONE] * n + claim["differences"], strict=True)
    claim["moves"] = moves = [[d if x else x for x in unit] for unit, d in ends if d]
    work = len(splits) * (graph.cost * (len(moves) + 2) + n**3 * {"quadratic": 500}.get(norm, 5))
    expect(work / 2 + len(claim["instants"]) * 5000 * (n + 1) ** 2 < _MOST_WORK, "too much work")
    known = norm in ("max", "sum", "quadratic") and owned == list(range(n))
    known &= min(v.low for v in claim["initial"] + claim["differences"]) >= 0.0
    expect(known, "claim: no such norm, a state in no or two blocks, or a distance below 0")
    for b in blocks:
        k = len(b["states"])
        p = b["metric"] = read(b["metric"], [[float, k], k], "claim.blocks.metric")
        off = [(p[i][j].low, p[j][i].low) for i in range(k) for j in range(i)]
        plain = all(x == y and (x == 0.0 or norm == "quadratic") for x, y in off)
        expect(plain and 0 < k <= 12 and positive(p), "claim.blocks.metric: defines no norm")
    for cell in _cells(claim["region"], splits):
        _check_cell(graph, claim, cell)
    drift, start = ([_norm(norm, b, claim[k]) for b in blocks] for k in ("mismatch", "initial"))
    for each in claim["instants"]:
        expect(0 <= each["time_s"].low <= claim["horizon_s"].low, "an instant after the horizon")
        sizes = grown([b["comparison"] for b in blocks], drift, start, each["time_s"])
        for b, size in zip(blocks, sizes, strict=True):
            widths = enumerate(each["widths"][state] for state in b["states"])
            holds = all(_covers(norm, b["metric"], i, size, w) for i, w in widths)
            require(holds, "a width is smaller than the bound gives")


def _cells(region: Vector, splits: Sequence[Any]) -> Iterator[list[Interval]]:
    """Leaves of a binary tree in preorder, null a leaf: they cover the region by construction."""
    pending = [list(region)]
    for split in splits:
        cell = pending.pop()
        if split is None:
            yield cell
        else:
            k, cut = split["axis"], split["at"].low
            expect(cell[k].low < cut < cell[k].high, "proof.splits: a cut outside its cell")
            for half in (Interval(cut, cell[k].high), Interval(cell[k].low, cut)):
                pending.append([*cell[:k], half, *cell[k + 1 :]])
    expect(not pending, "proof.splits: the tree does not end")


def _check_cell(graph: Graph, claim: Any, cell: Vector) -> None:
    """Sizes, norms and logarithmic norms are convex: averages of Jacobians obey them too."""
    values, n = graph.values([*cell, *claim["ranges"]]), graph.n
    columns = [graph.tangent(values, move) for move in claim["moves"]]
    felt = zip(zip(*columns, strict=True), claim["mismatch"], strict=True)
    holds = all(sum((Interval(x.size()) for x in row[n:]), ZERO).high <= y.low for row, y in felt)
    require(holds, "the mismatch is too small")
    for (k, b), (j, c) in itertools.product(enumerate(claim["blocks"]), repeat=2):
        part = [[columns[column][row] for column in c["states"]] for row in b["states"]]
        other, bound, p = (None if j == k else c["metric"]), b["comparison"][j], b["metric"]
        if claim["norm"] == "quadratic":
            corners = (_corners(part, count) for count in (0, _CORNER_ENTRIES))
            holds = any(all(_definite(a, p, other, bound) for a in each) for each in corners)
        else:
            holds = _weighted(claim["norm"], part, p, other, bound)
        require(holds, f"entry {k}, {j} of the comparison is too small")


def _weighted(norm: str, a: Matrix, p: Matrix, other: Matrix | None, bound: Interval) -> bool:
    """Row sums (max) or column sums (sum) of |a_ij| p_i / p_j, a diagonal with its sign."""
    top = [[Interval(x.size()) for x in row] for row in a]
    for i in range(0 if other else len(a)):
        top[i][i] = Interval(a[i][i].high)
    q = other or p
    shares = [[x * p[i][i] / q[j][j] for j, x in enumerate(row)] for i, row in enumerate(top)]
    sums = shares if norm == "max" else zip(*shares, strict=True)
    return all(sum(row, ZERO).high <= bound.low for row in sums)


def _corners(a: Matrix, count: int) -> Iterator[Matrix]:
    """Matrices with the widest entries at their ends; their convex hull holds `a`."""
    wide = sorted((x.high - x.low, i, j) for i, r in enumerate(a) for j, x in enumerate(r))[::-1]
    wide = [entry for entry in wide[:count] if entry[0] > 1e-9]
    for ends in itertools.product((0, 1), repeat=len(wide)):
        corner = [list(row) for row in a]
        for (_, i, j), end in zip(wide, ends, strict=True):
            corner[i][j] = Interval(a[i][j].high if end else a[i][j].low)
        yield corner


def _definite(a: Matrix, p: Matrix, other: Matrix | None, bound: Interval) -> bool:
    """a' P + P a < 2 c P or, between blocks, [[c R, a' P], [P a, c P]] > 0 (or a = 0)."""
    pa, scaled = product(p, a), [[bound * x for x in row] for row in p]
    if other is None:
        half = [list(map(sub, *rows)) for rows in zip(scaled, pa, strict=True)]
        return positive([[x + half[j][i] for j, x in enumerate(row)] for i, row in enumerate(half)])
    if not any(x for row in a for x in row):
        return bound.low >= 0.0
    upper = [[*(bound * x for x in row), *(r[j] for r in pa)] for j, row in enumerate(other)]
    return positive(upper + [[*pa[i], *row] for i, row in enumerate(scaled)])


def _norm(norm: str, block: Any, radii: Vector) -> Interval:
    """An upper bound of the norm over the box of these radii; a quadratic has it at a corner."""
    p, radius = block["metric"], [radii[state] for state in block["states"]]
    terms = [p[i][i] * r for i, r in enumerate(radius)]
    if norm != "quadratic":
        return sum(terms, ZERO) if norm == "sum" else max(terms, key=lambda x: x.high)
    corners = itertools.product(*((r, -r) for r in radius))
    return Interval(max(dot(v, apply(p, v)).high for v in corners)).sqrt()


def _covers(norm: str, p: Matrix, i: int, size: Interval, width: Interval) -> bool:
    """Whether a norm of `size` keeps |e_i| <= width; quadratic: [[P, s e_i], [s e_i', w^2]] > 0."""
    if norm != "quadratic":
        return (size / p[i][i]).high <= width.low
    column = [size if k == i else ZERO for k in range(len(p))]
    rows = [*([*row, column[k]] for k, row in enumerate(p)), [*column, width**2]]
    return width.low >= 0.0 and positive(rows)


def tube(graph: Graph, claim: Any, proof: Any) -> None:
    """Each solution of the model from `initial` at times_s[0], with any measurable inputs in
    `ranges`, exists up to the last of `times_s`, lies in instants[k] at times_s[k] and in rows[k]
    for times_s[k] <= t <= times_s[k+1]."""
    n, box, vector = graph.n, [Interval, graph.n], [float, graph.n]
    claim = read(claim, {"initial": box, "ranges": [Interval, graph.m], "times_s": [float, None],
                         "instants": [box, None], "rows": [box, None]}, "claim")  # fmt: skip
    form = {"center": vector, "frame": [vector, n], "inverse": [vector, n], "radius": vector}
    steps = [{"box": box, "cores": [box, None]}, None]
    proof = read(proof, {"frames": [form, None], "steps": steps}, "proof")
    each = 4 * graph.cost * (n + 2) + 100 * (n + 5) ** 3
    work = sum(each + 4 * graph.cost * len(step["cores"]) for step in proof["steps"])
    expect(work < _MOST_WORK, "too much work")
    for f, instant, _ in zip(proof["frames"], claim["instants"], claim["times_s"], strict=True):
        f["inverse"] = _inverse(f["inverse"], f["frame"])
        f["reach"] = [Interval(-r.low, r.low) for r in f["radius"]]
        f["states"] = list(map(add, f["center"], apply(f["frame"], f["reach"])))
        _require_within(f["states"], instant, "an instant")
    first, pairs = proof["frames"][0], itertools.pairwise(proof["frames"])
    start = apply(first["inverse"], list(map(sub, claim["initial"], first["center"])))
    _require_within(start, first["reach"], "the initial set")
    lengths = (b - a for a, b in itertools.pairwise(claim["times_s"]))
    for step, row, length, pair in zip(proof["steps"], claim["rows"], lengths, pairs, strict=True):
        _step(graph, claim["ranges"], step | {"row": row, "length": length}, *pair)


def _step(graph: Graph, ranges: Vector, step: Any, frame: Any, after: Any) -> None:
    """Picard: the set stays in `box`, the solution xi from c with middle inputs in `cores` (halves
    of denormals round, so min, max). e = x - xi has e' = J e + r, column j over box_1 .. box_j and
    cores beyond; v = T^-1 exp(-A t) e has v' = T^-1 exp(-A t) ((J - A) e + r), A J's midpoint."""
    n, box, length, still = graph.n, step["box"], step["length"].inside(0.0), [ZERO] * graph.m
    middle = [Interval(min(max(r.low / 2 + r.high / 2, r.low), r.high)) for r in ranges]
    _stays(frame["states"], graph.rates([*box, *ranges]), length, box)
    here, core, part = frame["center"], step["cores"][0], length / Interval(len(step["cores"]))
    for each in step["cores"]:
        rates = graph.rates([*each, *middle])
        _stays(here, rates, part, each)
        bent = graph.tangent(graph.values([*each, *middle]), [*rates, *still])
        ahead, half = graph.rates([*here, *middle]), part * part / Interval(2)
        here = [x + part * v + half * a for x, v, a in zip(here, ahead, bent, strict=True)]
        core = [x.hull(y) for x, y in zip(core, each, strict=True)]
    _require_within(core, box, "a core")
    mixed = [graph.values([*box[: j + 1], *core[j + 1 :], *ranges]) for j in range(n)]
    jacobian = list(zip(*map(graph.tangent, mixed, graph.units), strict=True))
    center = [[Interval(x.low / 2 + x.high / 2) for x in row] for row in jacobian]
    rest = [list(map(sub, *rows)) for rows in zip(jacobian, center, strict=True)]
    felt = graph.tangent(graph.values([*core, *ranges]), [ZERO] * n + [*map(sub, ranges, middle)])
    (end, onward), (_, back) = (_flows(center, length * x) for x in (ONE, -ONE))
    back, onward = product(frame["inverse"], back), product(onward, frame["frame"])
    growth = [[Interval(x.size()) for x in row] for row in product(product(back, rest), onward)]
    drift = [Interval(x.size()) for x in apply(back, felt)]
    most = [Interval(-v.low, v.low) for v in grown(growth, drift, frame["radius"], length)]
    _require_within(list(map(add, core, apply(onward, most))), step["row"], "a row")
    moved = apply(product(after["inverse"], product(end, frame["frame"])), most)
    offset = apply(after["inverse"], list(map(sub, here, after["center"])))
    _require_within(list(map(add, moved, offset)), after["reach"], "a step")


def _stays(at: Vector, rates: Vector, t: Interval, box: Vector) -> None:
    _require_within([x + t.hull(ZERO) * v for x, v in zip(at, rates, strict=True)], box, "a box")


def _require_within(inner: Vector, outer: Vector, what: str) -> None:
    holds = all(y.low < x.low and x.high < y.high for x, y in zip(inner, outer, strict=True))
    require(holds, f"{what} does not hold what it should in its interior")


def _inverse(g: Matrix, t: Matrix) -> Matrix:
    """G + (E + E^2 + ...) G with E = I - G T: within 2 |E| max_i |g_ij| of G for |E| <= 1/2."""
    gap = [[x - Interval(i == j) for j, x in enumerate(row)] for i, row in enumerate(product(g, t))]
    off = max(sum((Interval(x.size()) for x in row), ZERO).inside(0.0, 0.5).high for row in gap)
    far = [Interval(2 * off) * Interval(max(x.size() for x in col)) for col in zip(*g, strict=True)]
    return [[x + f.hull(-f) for x, f in zip(row, far, strict=True)] for row in g]


def _flows(a: Matrix, t: Interval) -> list[Matrix]:
    """exp(A t), and a hull of exp(A s) over 0 <= s <= t, for |A t| <= 1 in row sums."""
    terms = [[[Interval(i == j) for j in range(len(a))] for i in range(len(a))]]
    for k in range(1, 7):
        terms.append([[x * t / Interval(k) for x in row] for row in product(a, terms[-1])])
    size = max(sum((Interval(x.size()) for x in row), ZERO).high for row in terms[1])
    rest = Interval(-1.0, 1.0) * Interval(size).inside(0.0, 1.0) ** 7 / Interval(4000)  # 7! = 5040
    terms.append([[rest] * len(a)] * len(a))
    hulls = [terms[0], *([[x.hull(ZERO) for x in row] for row in term] for term in terms[1:])]
    cells = range(len(a))
    return [
        [[sum((t[i][j] for t in s), ZERO) for j in cells] for i in cells] for s in (terms, hulls)
    ]
