// Everything of lockstep that an application needs. SPDX-License-Identifier: Apache-2.0
//
//     Model model = import_urdf_file("gripper.urdf").model;      // or fill a Model in code
//     Plan plan = compile(model, {.dt = 1.0 / 240});             // plan.describe() says what a step does
//     Batch<float> batch(plan, 4096);
//     batch.position_targets().row(plan.dof("knuckle")) = 0.4f;
//     batch.step(4);                                             // four sub-steps for one action
#pragma once

#include "lockstep/actions.h"
#include "lockstep/batch.h"
#include "lockstep/enums.h"
#include "lockstep/environment_set.h"
#include "lockstep/error.h"
#include "lockstep/export_model.h"
#include "lockstep/generate.h"
#include "lockstep/import.h"
#include "lockstep/model.h"
#include "lockstep/plan.h"
#include "lockstep/query.h"
#include "lockstep/random.h"
#include "lockstep/softness.h"
#include "lockstep/step.h"
#include "lockstep/version.h"
