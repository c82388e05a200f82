"""`interdrive sql`: a question to the data set of a batch."""

from __future__ import annotations

import csv
import sys

import click


@click.command()
@click.argument("folder", metavar="DIR")
@click.argument("question", metavar="SQL")
@click.option("--csv", "as_csv", is_flag=True, help="Print all rows as CSV.")
def sql(folder: str, question: str, as_csv: bool) -> None:
    """Ask the data set of the batch in DIR a question in SQL; needs the extra duckdb.

    Tables are results (a row per run and agent), runs (a row per run) and agents (a row per agent under test):

        interdrive sql out/batch "select planner, outcome, count(*) from agents group by all order by all"
    """
    from interdrive.batches import query  # noqa: PLC0415
    from interdrive.cli.batch_report import print_answer  # noqa: PLC0415 - rich

    answer = query(folder, question)
    if as_csv:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(answer.columns)
        writer.writerows(answer.rows)
    else:
        print_answer(answer)
