"""The C header of a decision kernel: its entry point, its buffers and what is where in them."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.runtime.layout import KERNEL_VERDICTS, KernelCause, KernelStatus
from workbench.runtime.manifest import Field

_HEAD = """\
/* The decision kernel: C99, no heap, no state between calls, the caller owns the buffers.
 *
 * query: WB_QUERY_SIZE doubles, read only; result: WB_RESULT_SIZE, written whole; work: as many as
 * wb_work_size() says, contents irrelevant. They must not overlap. wb_decide returns 0; what could
 * not be judged is in the result (WB_R_STATUS, verdicts). Round to nearest and subnormal numbers
 * are assumed: check before and after. Fields are runs of doubles from WB_Q_... or WB_R_... on;
 * units are SI, see manifest.json.
 */
#ifndef WB_DECISION_H
#define WB_DECISION_H
#ifdef __cplusplus
extern "C" {
#endif
"""
_TAIL = """\
long long wb_query_size(void);
long long wb_result_size(void);
long long wb_work_size(void);
int wb_decide(const double *query, double *result, double *work);
#ifdef __cplusplus
}
#endif
#endif"""


def decision_header(query: Sequence[Field], result: Sequence[Field]) -> str:
    """C text that a user of the kernel includes; the kernel's own text contains it too."""
    sizes = {
        f"{name}_SIZE": fields[-1].offset + fields[-1].count
        for name, fields in (("QUERY", query), ("RESULT", result))
    }
    lines = [f"#define WB_{name} {size}" for name, size in sizes.items()]
    for letter, fields in (("Q", query), ("R", result)):
        lines += [
            f"#define WB_{letter}_{field.name.upper()} {field.offset} /* {field.count} */"
            for field in fields
        ]
    verdicts = ", ".join(f"{verdict.value} {i}" for i, verdict in enumerate(KERNEL_VERDICTS))
    statuses = ", ".join(f"{status.name} {status.value}" for status in KernelStatus)
    causes = ", ".join(f"{cause.name} {cause.value}" for cause in KernelCause)
    notes = f"/* verdicts: {verdicts}\n * status: {statuses}\n * cause of a clearance: {causes} */"
    return "\n".join([_HEAD.rstrip(), *lines, notes, _TAIL])
