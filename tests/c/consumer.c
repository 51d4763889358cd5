/* A C89 program steps 64 grippers. SPDX-License-Identifier: Apache-2.0 */
#include <lockstep/c.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures = 0;

static void expect(int holds, const char* what) {
  if (holds) return;
  fprintf(stderr, "%s; the last message is: %s\n", what, lockstep_message());
  ++failures;
}

static float* at(const lockstep_array* array, long row, long environment) {
  return (float*)((char*)array->data + row * array->stride[0] + environment * array->stride[1]);
}

int main(int count, char** arguments) {
  lockstep_model* model = NULL;
  lockstep_model* copy = NULL;
  lockstep_plan* plan = NULL;
  lockstep_batch* batch = NULL;
  lockstep_batch* other = NULL;
  lockstep_settings settings;
  lockstep_options options;
  lockstep_pose_noise noise;
  lockstep_root_noise of_root;
  lockstep_randomization randomization;
  lockstep_query query;
  lockstep_array positions, targets, faults, steps, errors;
  int64_t dofs = 0, knuckle = -1, driven = 0;
  uint64_t bytes = 0;
  void* saved;
  float numbers[64 * 5], worst = 0.0f;
  unsigned char mask[64];
  const char* text = NULL;
  char words[200];
  int i;

  if (count != 2) return 2;
  expect(lockstep_abi() == 1, "the ABI must be 1");
  expect(lockstep_model_from_urdf("/no/such/file.urdf", &model) == LOCKSTEP_IMPORT_ERROR && model == NULL,
         "a missing file must be an import error");
  expect(strstr(lockstep_message(), "/no/such/file.urdf") != NULL, "the message must name the file");
  expect(lockstep_model_from_file(arguments[1], "home", NULL, 0, &model) == LOCKSTEP_SETTINGS_ERROR && model == NULL,
         "URDF has no keyframes");
  expect(lockstep_model_from_file(arguments[1], NULL, "", 8, &model) == LOCKSTEP_USAGE_ERROR, "flags must be known");
  expect(lockstep_model_from_file(arguments[1], NULL, "", 0, &model) == LOCKSTEP_OK, "any file must be read");
  lockstep_model_free(model);
  expect(lockstep_model_from_urdf(arguments[1], &model) == LOCKSTEP_OK, "the gripper must be read");
  expect(lockstep_model_set_drive(model, "knuckle", 8.0, 0.3) == LOCKSTEP_OK, "the knuckle must take a drive");
  expect(lockstep_model_report(model, &text) == LOCKSTEP_OK && strstr(text, "5 couplings") != NULL, "there is a report");
  expect(lockstep_model_export(model, "gripper.xml", 0.0, &text) == LOCKSTEP_OK &&
             strstr(text, "warning: velocity limits, left out") != NULL,
         "the gripper must be written, and what MJCF lacks be named");
  expect(lockstep_model_from_file("gripper.xml", "start", NULL, 0, &copy) == LOCKSTEP_OK, "what is written is read");
  lockstep_model_free(copy);
  remove("gripper.xml");
  expect(lockstep_model_export(model, "gripper.sdf", 0.0, NULL) == LOCKSTEP_USAGE_ERROR, "formats must be known");
  expect(lockstep_model_export(model, "gripper.xml", -1.0, NULL) == LOCKSTEP_SETTINGS_ERROR, "steps are above 0");
  expect(lockstep_model_set_drive(model, "nothing", 8.0, 0.3) == LOCKSTEP_MODEL_ERROR, "joints must be known");

  lockstep_settings_init(&settings);
  settings.per_environment = 1u << LOCKSTEP_GEAR_RATIO | 1u << LOCKSTEP_MASS;
  settings.method = "magic";
  expect(lockstep_compile(model, &settings, &plan) == LOCKSTEP_SETTINGS_ERROR, "methods must be known");
  settings.method = "automatic";
  expect(lockstep_compile(model, &settings, &plan) == LOCKSTEP_OK, "the gripper must compile");
  lockstep_model_free(model);
  expect(lockstep_plan_count(plan, LOCKSTEP_DOFS, &dofs) == LOCKSTEP_OK && dofs == 9, "there are nine dofs");
  expect(lockstep_plan_count(plan, LOCKSTEP_DRIVEN, &driven) == LOCKSTEP_OK && driven == 1, "one is driven");
  expect(lockstep_plan_name(plan, LOCKSTEP_DRIVEN, 0, &text) == LOCKSTEP_OK && strcmp(text, "knuckle") == 0,
         "it is the knuckle");
  expect(lockstep_plan_name(plan, LOCKSTEP_DRIVEN, 1, &text) == LOCKSTEP_USAGE_ERROR, "there is no second one");
  expect(lockstep_plan_index(plan, LOCKSTEP_DOFS, "knuckle", &knuckle) == LOCKSTEP_OK, "it has an index");

  lockstep_options_init(&options);
  options.environments = 64;
  options.threads = 1;
  options.seed = 5;
  expect(lockstep_batch_new(plan, &options, &batch) == LOCKSTEP_OK, "a batch must be made");
  options.environments = -1;
  expect(lockstep_batch_new(plan, &options, &other) == LOCKSTEP_SETTINGS_ERROR && other == NULL, "-1 is no size");

  lockstep_randomization_init(&randomization);
  randomization.parameter = LOCKSTEP_GEAR_RATIO;
  randomization.low = 0.9;
  randomization.high = 1.1;
  expect(lockstep_randomize(batch, &randomization, NULL, 0) == LOCKSTEP_OK, "ratios must be randomised");
  randomization.low = -1.0;
  expect(lockstep_randomize(batch, &randomization, NULL, 0) == LOCKSTEP_USAGE_ERROR, "a ratio of 0 is impossible");
  expect(lockstep_reset_random(batch, NULL, 0, 0.5, 0.0) == LOCKSTEP_OK, "states must be randomised");
  lockstep_pose_noise_init(&noise);
  noise.position = 0.1;
  expect(lockstep_reset_to(batch, NULL, &noise, NULL, 0) == LOCKSTEP_OK, "states must lie about the start");
  expect(lockstep_copy(batch, 3, NULL, 0) == LOCKSTEP_OK, "a state must be copied to all");
  expect(lockstep_reset_to(batch, "home", NULL, NULL, 0) == LOCKSTEP_USAGE_ERROR, "the gripper has no poses");
  expect(lockstep_copy(batch, 64, NULL, 0) == LOCKSTEP_USAGE_ERROR, "environments are those of the batch");
  lockstep_root_noise_init(&of_root);
  of_root.link = "palm";
  noise.roots = &of_root;
  noise.root_count = 1;
  expect(lockstep_reset_to(batch, NULL, &noise, NULL, 0) == LOCKSTEP_USAGE_ERROR, "no root of the gripper floats");

  expect(lockstep_field(batch, LOCKSTEP_POSITIONS, &positions) == LOCKSTEP_OK && positions.shape[0] == 9 &&
             positions.shape[1] == 64 && positions.type == LOCKSTEP_F32,
         "positions are 9 x 64 floats");
  expect(lockstep_field(batch, LOCKSTEP_POSITION_TARGETS, &targets) == LOCKSTEP_OK, "there are targets");
  expect(lockstep_field(batch, LOCKSTEP_FAULTS, &faults) == LOCKSTEP_OK && (faults.flags & LOCKSTEP_READ_ONLY) != 0,
         "faults are read-only");
  expect(lockstep_field(batch, LOCKSTEP_STEPS, &steps) == LOCKSTEP_OK, "there are steps");
  expect(lockstep_field(batch, LOCKSTEP_PARAMETER + LOCKSTEP_DAMPING, &errors) == LOCKSTEP_USAGE_ERROR,
         "damping was not declared");
  for (i = 0; i < 64; ++i) *at(&targets, (long)knuckle, i) = 0.3f;
  expect(lockstep_step(batch, 0) == LOCKSTEP_USAGE_ERROR, "0 steps are refused");
  expect(lockstep_step(batch, 240) == LOCKSTEP_OK, "a second must pass");
  for (i = 0; i < 64; ++i) {
    expect(*(const uint32_t*)at(&faults, 0, i) == 0, "nothing may fail");
    expect(*(const uint32_t*)at(&steps, 0, i) == 240, "240 steps were taken");
    expect(fabs((double)*at(&positions, (long)knuckle, i) - 0.3) < 0.1, "the knuckle must be near its target");
  }

  memset(&errors, 0, sizeof errors);
  errors.size = sizeof errors;
  errors.data = numbers;
  errors.type = LOCKSTEP_F32;
  errors.rank = 2;
  errors.shape[0] = 5;
  errors.shape[1] = 64;
  errors.stride[0] = (int64_t)sizeof(float);
  errors.stride[1] = 5 * (int64_t)sizeof(float);
  memset(&query, 0, sizeof query);
  query.size = sizeof query;
  query.quantity = LOCKSTEP_READ_COUPLING_ERROR;
  query.row = -1;
  query.scale = 1.0;
  expect(lockstep_read(batch, &query, 1, &errors) == LOCKSTEP_OK, "errors must be read");
  for (i = 0; i < 64 * 5; ++i) worst = fabs((double)numbers[i]) > worst ? (float)fabs((double)numbers[i]) : worst;
  expect(worst < 1e-6f, "couplings must hold");
  errors.shape[0] = 4;
  expect(lockstep_read(batch, &query, 1, &errors) == LOCKSTEP_USAGE_ERROR, "a wrong shape must be refused");

  expect(lockstep_save(batch, NULL, &bytes) == LOCKSTEP_OK && bytes > 0, "the size must be told");
  saved = malloc((size_t)bytes);
  expect(lockstep_save(batch, saved, &bytes) == LOCKSTEP_OK, "a batch must be saved");
  lockstep_step(batch, 10);
  worst = *at(&positions, 0, 7);
  expect(lockstep_restore(batch, saved, bytes) == LOCKSTEP_OK, "and restored");
  lockstep_step(batch, 10);
  expect(worst == *at(&positions, 0, 7), "and go on with the same bits");
  expect(lockstep_restore(batch, saved, bytes - 1) == LOCKSTEP_USAGE_ERROR, "half a batch must be refused");
  expect(strcmp(lockstep_code(), "usage.save") == 0, "by a code");
  free(saved);

  *at(&positions, 0, 3) = (float)HUGE_VAL;
  lockstep_step(batch, 1);
  expect(*(const uint32_t*)at(&faults, 0, 3) != 0, "an infinite position must be a fault");
  expect(lockstep_explain_fault(batch, 3, words, sizeof words) == LOCKSTEP_OK && strstr(words, "not_finite") != NULL,
         "and be explained");
  expect(strcmp(lockstep_fault_code(*(const uint32_t*)at(&faults, 0, 3)), "fault.not_finite") == 0, "and have a code");
  expect(strcmp(lockstep_fault_code(0), "") == 0 && strcmp(lockstep_fault_code(77), "") == 0, "which others have not");
  memset(mask, 0, sizeof mask);
  mask[3] = 1;
  expect(lockstep_reset_mask(batch, mask, 63, 0) == LOCKSTEP_USAGE_ERROR, "a mask has an entry for each environment");
  expect(lockstep_reset_mask(batch, mask, 64, 0) == LOCKSTEP_OK, "it must be reset");
  expect(*(const uint32_t*)at(&faults, 0, 3) == 0, "which clears the fault");
  expect(lockstep_reset_mask(batch, mask, 64, 2) == LOCKSTEP_USAGE_ERROR, "unknown flags must be refused");
  expect(lockstep_reset_mask(batch, mask, -1, 0) == LOCKSTEP_USAGE_ERROR, "a negative length must be refused");
  expect(lockstep_reset_ids(batch, NULL, -1, 0) == LOCKSTEP_USAGE_ERROR, "here, too");
  expect(lockstep_plan_index(plan, LOCKSTEP_ROOTS, NULL, &dofs) == LOCKSTEP_USAGE_ERROR, "a name must be given");
  query.row = -7;
  expect(lockstep_read(batch, &query, 1, &errors) == LOCKSTEP_USAGE_ERROR, "rows are -1 or more");
  expect(lockstep_step(NULL, 1) == LOCKSTEP_USAGE_ERROR, "null is refused");

  lockstep_batch_free(batch);
  lockstep_plan_free(plan);
  lockstep_plan_free(NULL);
  printf("%d failures\n", failures);
  return failures != 0;
}
