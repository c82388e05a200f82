"""Two planners on three scenarios, in processes of their own; a second call would do nothing."""

import interdrive as idr
from interdrive.comparison import compare


def main() -> None:
    done = idr.batch(["t_junction", "lane_merge", "highway"], "out/batch", planner="idm,idm_mobil", workers=2)
    print(f"{len(done.keys)} runs: {dict(done.status)}")
    for row in compare(done.folder).table.to_pylist():
        print(f"{row['variant']}: {row['n_agents']} agents, {row['goal_reached']:.0f} % reached their goal in time")


if __name__ == "__main__":
    main()
