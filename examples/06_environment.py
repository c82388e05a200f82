"""One car learns among planning traffic: random actions, and how its episodes end."""

from collections import Counter

import gymnasium

env = gymnasium.make("interdrive.envs:interdrive/TJunction-v1")
env.action_space.seed(0)
observation, info = env.reset(seed=0)
print(f"{observation.shape[0]} numbers are observed, {env.action_space.shape[0]} are an action")

ends: Counter[str] = Counter()
for _ in range(500):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    if terminated or truncated:
        ends["off the road" if info["off_road"] else info["outcome"]] += 1
        observation, info = env.reset()
print(", ".join(f"{end}: {count}" for end, count in sorted(ends.items())))
