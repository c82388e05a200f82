"""Check that the score against a panel cannot be gamed: drivers with a vice must rank below honest ones.

found = interdrive.adversaries.rank_adversaries(set="public-1", scenarios="scenarios")
found.n_below, len(found.judged)    # adversaries that rank below, of those judged

docs/how_to/adversaries.md says how to use it.
"""

from interdrive.adversaries.drivers import ADVERSARIES, Adversary
from interdrive.adversaries.ranking import Ranking, Verdict, rank_adversaries
from interdrive.adversaries.trial import Drive

__all__ = ["ADVERSARIES", "Adversary", "Drive", "Ranking", "Verdict", "rank_adversaries"]
