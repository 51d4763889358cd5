# lockstep for Python. SPDX-License-Identifier: Apache-2.0
"""Steps thousands of identical articulated mechanisms with mimic joints at once.

    import lockstep as ls
    model = ls.from_urdf("gripper.urdf")
    plan = ls.compile(model, vary=["gear_ratio"])
    batch = plan.batch(4096, threads=2)
    batch.q_target[:, plan.dof("knuckle")] = 0.4
    batch.step(4)

Arrays of a batch are live views: [num_envs, k], without copies, valid for ever. `batch.rows` has the same memory as
[k, num_envs], which is the fast layout. Copy what you keep: `batch.q.copy()`.
"""

from ._lockstep import (
    Batch,
    Plan,
    Rows,
    __version__,
    compile,
    export_mjcf,
    export_urdf,
    from_file,
    from_mjcf,
    from_mjcf_text,
    from_urdf,
    from_urdf_text,
    load_kernel,
)
from ._lockstep import _require_main_interpreter
from .errors import Error, ImportFileError, ModelError, SettingsError, UsageError
from .model import (
    CamTable,
    Collider,
    Contact,
    Coupling,
    Drive,
    ErpCfm,
    Export,
    Frequency,
    Hard,
    Harmonic,
    Inertia,
    Joint,
    Link,
    Loop,
    Model,
    NamedPose,
    Polynomial,
    Root,
    Shape,
    Site,
    Softness,
    Spring,
    TendonSegment,
    VisualMesh,
    infinity,
    pose,
)
from .query import Query
from .recording import Recording
from .start import RootNoise, Start

_require_main_interpreter()

__all__ = [
    "Batch",
    "CamTable",
    "Collider",
    "Contact",
    "Coupling",
    "Drive",
    "ErpCfm",
    "Error",
    "Export",
    "Frequency",
    "Hard",
    "Harmonic",
    "ImportFileError",
    "Inertia",
    "Joint",
    "Link",
    "Loop",
    "Model",
    "ModelError",
    "NamedPose",
    "Plan",
    "Polynomial",
    "Query",
    "Recording",
    "Root",
    "RootNoise",
    "Rows",
    "SettingsError",
    "Shape",
    "Site",
    "Softness",
    "Spring",
    "Start",
    "TendonSegment",
    "UsageError",
    "VisualMesh",
    "__version__",
    "compile",
    "export_mjcf",
    "export_urdf",
    "from_file",
    "from_mjcf",
    "from_mjcf_text",
    "from_urdf",
    "from_urdf_text",
    "infinity",
    "load_kernel",
    "pose",
]
