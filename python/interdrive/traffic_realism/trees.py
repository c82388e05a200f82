"""A two-sample classifier: gradient boosted trees on binned features."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.traffic_realism.estimators import auc

if TYPE_CHECKING:
    from interdrive.array_types import Bools, Floats, Ints

#: Trees, leaves of each, learning rate, weight of the squares of leaf values, least samples of a leaf, bins.
_TREES, _LEAVES, _RATE, _L2, _LEAF_MIN, _BINS = 80, 15, 0.1, 1.0, 20, 64
#: Parts of which each is predicted by trees that have not seen it.
_FOLDS = 5


def two_sample_auc(features: Floats, is_simulated: Bools, groups: Ints, seed: int = 0) -> float:
    """How well trees tell two kinds of samples apart that they have not seen: 0.5 not at all, 1 always.

    Boosting with logistic loss and second-order leaves: Friedman, "Greedy function approximation: a gradient boosting
    machine", Annals of Statistics 29, 2001, doi 10.1214/aos/1013203451. All samples of a group are in the same fold.

    Args:
        features: Shape (samples, features); nan is a value of its own.
        is_simulated: Shape (samples,).
        groups: Shape (samples,).
        seed: Of the folds.

    Returns:
        The area under the curve of all out-of-fold scores; nan below two groups.
    """
    if len(np.unique(groups)) < 2:
        return float("nan")
    scores, _, fold = unseen_scores(features, is_simulated, groups, features[:0], groups[:0], seed)
    ranks = np.zeros(len(features))
    for one in np.unique(fold):
        # Folds are compared by ranks: the trees of each have their own base rate.
        ranks[fold == one] = _ranked(scores[fold == one])
    return auc(ranks, is_simulated)


def unseen_scores(
    features: Floats, is_simulated: Bools, groups: Ints, asked: Floats, asked_groups: Ints, seed: int = 0
) -> tuple[Floats, Floats, Ints]:
    """Scores of samples, and of others, by trees that have seen nothing of their groups.

    Args:
        features: Shape (samples, features); nan is a value of its own.
        is_simulated: Shape (samples,).
        groups: Shape (samples,); at least two.
        asked: Features of others.
        asked_groups: Their groups, which the samples have, too.
        seed: Of the folds.

    Returns:
        Log odds of being simulated of the samples and of the others; the fold of each sample.
    """
    distinct = np.unique(groups)
    fold_of = np.random.default_rng(seed).permutation(len(distinct)) % min(_FOLDS, len(distinct))
    fold, asked_fold = (fold_of[np.searchsorted(distinct, own)] for own in (groups, asked_groups))
    scores, asked_scores = np.zeros(len(features)), np.zeros(len(asked))
    for one in np.unique(fold):
        out, asked_out = fold == one, asked_fold == one
        both = _boosted(features[~out], is_simulated[~out], np.concatenate((features[out], asked[asked_out])))
        scores[out], asked_scores[asked_out] = both[: out.sum()], both[out.sum() :]
    return scores, asked_scores, fold


def _ranked(scores: Floats) -> Floats:
    _, place, counts = np.unique(scores, return_inverse=True, return_counts=True)
    found: Floats = (np.cumsum(counts) - 0.5 * (counts - 1))[place] / (len(scores) + 1.0)
    return found


def _boosted(features: Floats, labels: Bools, asked: Floats) -> Floats:
    """Scores of other samples (log odds)."""
    edges = [_edges(column) for column in features.T]
    binned, asked_bins = _binned(features, edges), _binned(asked, edges)
    share = float(np.clip(labels.mean(), 1e-6, 1.0 - 1e-6))
    base = np.log(share / (1.0 - share))
    own, found = np.full(len(features), base), np.full(len(asked), base)
    for _ in range(_TREES):
        probability = 1.0 / (1.0 + np.exp(-own))
        _grow(binned, labels - probability, probability * (1.0 - probability), (own, found), asked_bins)
    return found


def _edges(column: Floats) -> Floats:
    values = np.unique(column[np.isfinite(column)])
    if len(values) > _BINS - 2:
        values = np.unique(np.quantile(column[np.isfinite(column)], np.linspace(0.0, 1.0, _BINS - 1)))
    found: Floats = 0.5 * (values[:-1] + values[1:])
    return found


def _binned(features: Floats, edges: list[Floats]) -> Ints:
    """Bins of each feature, ascending; nan is in the last one."""
    columns = [
        np.where(np.isfinite(column), np.searchsorted(edge, column), _BINS - 1)
        for column, edge in zip(features.T, edges, strict=True)
    ]
    return np.stack(columns, axis=1).astype(np.int64)


def _grow(binned: Ints, gradient: Floats, hessian: Floats, scores: tuple[Floats, Floats], asked: Ints) -> None:
    """Adds a tree to both scores, split best first."""
    leaves = [(np.arange(len(binned)), np.arange(len(asked)))]
    splits = [_best_split(binned, gradient, hessian, leaves[0][0])]
    while len(leaves) < _LEAVES:
        best = int(np.argmax([gain for gain, *_ in splits]))
        gain, feature, at = splits[best]
        if gain <= 0.0:
            break
        members, queries = leaves[best]
        left, asked_left = binned[members, feature] <= at, asked[queries, feature] <= at
        parts = (members[left], queries[asked_left]), (members[~left], queries[~asked_left])
        leaves[best], splits[best] = parts[0], _best_split(binned, gradient, hessian, parts[0][0])
        leaves.append(parts[1])
        splits.append(_best_split(binned, gradient, hessian, parts[1][0]))
    for members, queries in leaves:
        value = _RATE * gradient[members].sum() / (hessian[members].sum() + _L2)
        scores[0][members] += value
        scores[1][queries] += value


def _best_split(binned: Ints, gradient: Floats, hessian: Floats, members: Ints) -> tuple[float, int, int]:
    """Gain, feature and last bin of the left side of the best split of some samples."""
    n = binned.shape[1]
    if len(members) < 2 * _LEAF_MIN:
        return -np.inf, 0, 0
    place = (binned[members] + _BINS * np.arange(n)).ravel()

    def summed(values: Floats | None) -> Floats:
        weights = None if values is None else np.repeat(values[members], n)
        table = np.bincount(place, weights, minlength=n * _BINS).reshape(n, _BINS)
        found: Floats = np.cumsum(table, axis=1)[:, :-1].astype(np.float64)
        return found

    count, g, h = summed(None), summed(gradient), summed(hessian)
    g_all, h_all = gradient[members].sum(), hessian[members].sum()
    gain = g**2 / (h + _L2) + (g_all - g) ** 2 / (h_all - h + _L2) - g_all**2 / (h_all + _L2)
    gain[(count < _LEAF_MIN) | (len(members) - count < _LEAF_MIN)] = -np.inf
    best = int(gain.argmax())
    return float(gain.flat[best]), best // (_BINS - 1), best % (_BINS - 1)
