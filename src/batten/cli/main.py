"""The command `batten`. Exit status: 0 fine, 1 a limit is broken, 2 bad input, 70 a fault of batten's, 130 Ctrl-C."""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
import traceback
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from batten.cli.approximate import approximate
from batten.cli.bend import bend
from batten.cli.compare import compare
from batten.cli.compare_splines import compare_splines
from batten.cli.live import live
from batten.cli.project import project
from batten.cli.rationalise import rationalise
from batten.cli.simulate import simulate
from batten.cli.spline import spline
from batten.cli.study import app as study_app
from batten.errors import BattenError, LimitError, NoSolutionError

# Whatever is needed for one command only is imported there: `batten --help` answers at once.

FINE, BROKEN_LIMIT, BAD_INPUT, FAULT, INTERRUPTED = 0, 1, 2, 70, 130

app = typer.Typer(
    name="batten",
    help="Design, check and make things with the curves that a bent rod really takes.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

# typer keeps its copy of click in different places from version to version; its errors have this ancestor.
_UsageError: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")


def _version(wanted: bool) -> None:
    if wanted:
        from batten.io.software import software_name

        typer.echo(software_name())
        raise typer.Exit()


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """Design, check and make things with the curves that a bent rod really takes."""


@app.command(short_help="A surface becomes a checked program for two robots.")
def cut(
    job: Annotated[Path, typer.Argument(metavar="JOB.toml", help="The job; docs/job-file.md lists its fields.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="OUT", help="Folder to write, whole or not at all.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON on stdout.")] = False,
    no_pictures: Annotated[bool, typer.Option("--no-pictures", help="Leave the report's large pictures out.")] = False,
) -> None:
    """From a surface to a checked program for two robots and a bent hot blade.

    Exit status: 0 the cut is whole; 1 a leaf was refused or a limit broken; 2 bad input.
    """
    from batten.cli.progress import StageProgress
    from batten.fabrication.cut import plan_cut
    from batten.fabrication.robot.cell import cell_from_job
    from batten.io.cut_files import write_cut
    from batten.io.cut_summary import cut_lines, cut_summary, is_whole
    from batten.io.job import load_job
    from batten.io.job_surface import read_job_surface

    job_values = load_job(job)
    cell = cell_from_job(job_values.cell)
    surface = read_job_surface(job_values.surface)
    with StageProgress() as progress:
        plan = plan_cut(job_values, surface, progress=progress)
        write_cut(plan, job_values, surface, cell, out, pictures=not no_pictures, progress=progress)
    if as_json:
        typer.echo(json.dumps(cut_summary(plan, out), ensure_ascii=False, indent=2, allow_nan=False))
    else:
        typer.echo("\n".join(cut_lines(plan, out)))
    raise typer.Exit(FINE if is_whole(plan) else BROKEN_LIMIT)


@app.command(short_help="Read a cut back and compute its checks again.")
def check(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A folder that `batten cut` made.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON on stdout.")] = False,
) -> None:
    """Read a cut back: compare its files with their sums and recompute every check from the stored numbers.

    Exit status: 0 all agrees and the cut is whole; 1 something differs, a leaf was refused or a limit broken; 2 bad input.
    """
    from batten.io.cut_check import check_cut
    from batten.io.cut_summary import is_whole

    stored, findings = check_cut(out)
    agrees = all(f.agrees for f in findings)
    if as_json:
        entries = [{"what": f.what, "agrees": f.agrees, "detail": f.detail} for f in findings]
        result = {"software": stored.software, "agrees": agrees, "whole": is_whole(stored.plan), "findings": entries}
        typer.echo(json.dumps(result, ensure_ascii=False, indent=2, allow_nan=False))
    else:
        width = max(len(f.what) for f in findings)
        for finding in findings:
            typer.echo(f"  {'same' if finding.agrees else 'DIFF'}  {finding.what:<{width}}  {finding.detail}")
        refused = len(stored.plan.refused_leaves)
        typer.echo(
            f"{stored.plan.name}: {'everything agrees' if agrees else 'something differs'}; "
            + (
                f"{refused} leaves are refused"
                if refused
                else "whole"
                if is_whole(stored.plan)
                else "a limit is broken"
            )
        )
    raise typer.Exit(FINE if agrees and is_whole(stored.plan) else BROKEN_LIMIT)


app.command(short_help="The curves of a drawing by pieces of elastica.")(approximate)
app.command(short_help="All shapes of a rod between two grippers.")(bend)
app.command(short_help="The scan of a cut part against the design.")(compare)
app.command("compare-splines", short_help="Every kind of spline through the same points.")(compare_splines)
app.command(short_help="A rod followed live, its ends tracked by sensors.")(live)
app.command(short_help="The curves of a drawing made such as a rod takes.")(project)
app.command(short_help="Faces from CAD in few blocks of elastica.")(rationalise)
app.command(short_help="The cut simulated from its robot program, against the design.")(simulate)
app.command(short_help="Fair curves through the points of a file.")(spline)
app.add_typer(study_app, name="study", short_help="The papers' experiments beside ours, at any size.")


def main(arguments: list[str] | None = None) -> int:
    """Run one command; errors become one line on stderr and an exit status.

    Parameters:
        arguments: the words after `batten`; those of the process without.

    Returns:
        The exit status.
    """
    signal.signal(signal.SIGTERM, _terminated)
    gc.set_threshold(50_000, 20, 20)  # what is imported makes no garbage: looking for it 500 times took 0.2 s of a cut
    try:
        words = sys.argv[1:] if arguments is None else arguments
        status = app(args=words or ["--help"], prog_name="batten", standalone_mode=False)
        sys.stdout.flush()
    except (LimitError, NoSolutionError) as error:
        return _complain(str(error), BROKEN_LIMIT)
    except BattenError as error:
        return _complain(str(error), BAD_INPUT)
    except _UsageError as error:
        return _complain(f"{error.format_message()} Try 'batten --help'.", BAD_INPUT)
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FINE
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _complain(f"{where}{error.strerror or error}; nothing was written", BAD_INPUT)
    except (KeyboardInterrupt, typer.Abort):
        return _complain("interrupted; nothing was written", INTERRUPTED)
    except Exception:
        traceback.print_exc()
        return _complain("this is a fault in batten; please report it with the lines above", FAULT)
    if status == INTERRUPTED:  # typer turns Ctrl-C into this status without a word
        return _complain("interrupted; nothing was written", INTERRUPTED)
    return status if isinstance(status, int) else FINE


def _complain(message: str, status: int) -> int:
    print(f"batten: {' '.join(message.split())}", file=sys.stderr)
    return status


def _terminated(number: int, frame: object) -> NoReturn:
    """A polite request to stop ends the program as Ctrl-C does: through all clean-up."""
    raise SystemExit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
