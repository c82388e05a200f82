"""The same encounter with another vehicle that replays, that adjusts its speed, and that plans."""

import interdrive as idr


def main() -> None:
    for degree, planner in (
        ("deterministic", "recorded"),
        ("semi-deterministic", "velocity_adjusting"),
        ("interactive", "rollout"),
    ):
        run = idr.simulate("lane_merge", agents="all", planner={"default": "rollout", 1001: planner})
        ends = ", ".join(f"{i} {end}" for i, end in zip(run.outcomes.agent_id, run.outcomes.outcome, strict=True))
        print(f"{degree}: {ends}")


if __name__ == "__main__":
    main()
