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

static lockstep_array rows_of(float* data, long rows, long environments) {
  lockstep_array array;
  memset(&array, 0, sizeof array);
  array.size = sizeof array;
  array.data = data;
  array.type = LOCKSTEP_F32;
  array.rank = 2;
  array.shape[0] = rows;
  array.shape[1] = environments;
  array.stride[0] = environments * (int64_t)sizeof(float);
  array.stride[1] = (int64_t)sizeof(float);
  return array;
}

static lockstep_records records_of(float* data, long rollouts, long steps, long rows) {
  lockstep_records records;
  memset(&records, 0, sizeof records);
  records.size = sizeof records;
  records.data = data;
  records.type = LOCKSTEP_F32;
  records.shape[0] = rollouts;
  records.shape[1] = steps;
  records.shape[2] = rows;
  records.stride[0] = steps * rows * (int64_t)sizeof(float);
  records.stride[1] = rows * (int64_t)sizeof(float);
  records.stride[2] = (int64_t)sizeof(float);
  return records;
}

static lockstep_query query_of(int32_t quantity, int32_t row) {
  lockstep_query query;
  memset(&query, 0, sizeof query);
  query.size = sizeof query;
  query.quantity = quantity;
  query.row = row;
  query.scale = 1.0;
  return query;
}

/* Actions of any kind, for one environment of two. */
static void act(lockstep_batch* batch, int32_t knuckle) {
  lockstep_action_map map;
  lockstep_array actions, efforts;
  float numbers[64];
  unsigned char mask[64];
  double scale = 2.0;
  int i;
  for (i = 0; i < 64; ++i) numbers[i] = 0.25f, mask[i] = i % 2;
  actions = rows_of(numbers, 1, 64);
  lockstep_action_map_init(&map);
  map.kind = LOCKSTEP_ACT_EFFORT;
  map.dofs = &knuckle;
  map.scale = &scale;
  expect(lockstep_act_as(batch, &map, &actions, mask, 64) == LOCKSTEP_USAGE_ERROR, "lists need a count");
  map.count = 1;
  expect(lockstep_act_as(batch, &map, &actions, mask, 64) == LOCKSTEP_OK, "efforts must be taken");
  expect(lockstep_field(batch, LOCKSTEP_EFFORTS, &efforts) == LOCKSTEP_OK, "there are efforts");
  for (i = 0; i < 64; ++i)
    expect(*at(&efforts, knuckle, i) == (i % 2 ? 0.5f : 0.0f), "an effort is the scale times its action");
  map.alpha = 0.5;
  expect(lockstep_act_as(batch, &map, &actions, mask, 64) == LOCKSTEP_OK && *at(&efforts, knuckle, 1) == 0.5f,
         "means must be taken");
  map.raw = 1;
  expect(lockstep_act_as(batch, &map, &actions, NULL, 0) == LOCKSTEP_USAGE_ERROR, "raw actions have no scale");
  map.raw = 0;
  map.kind = 7;
  expect(lockstep_act_as(batch, &map, &actions, NULL, 0) == LOCKSTEP_USAGE_ERROR, "kinds must be known");
  expect(lockstep_act_as(batch, NULL, &actions, NULL, 0) == LOCKSTEP_OK, "without a map it is as lockstep_act()");
  actions.shape[0] = 2;
  expect(lockstep_act_as(batch, NULL, &actions, NULL, 0) == LOCKSTEP_USAGE_ERROR, "a wrong shape must be refused");
}

/* Handles that were freed, of other kinds, and pointers that never were handles. */
static void expect_no_object(lockstep_plan* plan, lockstep_batch* freed) {
  lockstep_options options;
  lockstep_batch* next = NULL;
  lockstep_array array;
  int64_t count = 0;
  int local = 0;
  expect(lockstep_step(freed, 1) == LOCKSTEP_USAGE_ERROR && strstr(lockstep_message(), "freed") != NULL,
         "a freed batch must be refused");
  lockstep_batch_free(freed);
  expect(strstr(lockstep_message(), "freed") != NULL, "it cannot be freed again");
  lockstep_options_init(&options);
  options.threads = 1;
  expect(lockstep_batch_new(plan, &options, &next) == LOCKSTEP_OK && next != freed, "the next has another handle");
  expect(lockstep_step(freed, 1) == LOCKSTEP_USAGE_ERROR, "the freed one stays refused");
  expect(lockstep_step(next, 1) == LOCKSTEP_OK, "the next one works");
  expect(lockstep_step((lockstep_batch*)plan, 1) == LOCKSTEP_USAGE_ERROR &&
             strstr(lockstep_message(), "no batch") != NULL,
         "a plan is no batch");
  expect(lockstep_plan_count((const lockstep_plan*)&local, LOCKSTEP_DOFS, &count) == LOCKSTEP_USAGE_ERROR,
         "a pointer of the program is no plan");
  lockstep_plan_free((lockstep_plan*)next);
  expect(lockstep_field(next, LOCKSTEP_POSITIONS, &array) == LOCKSTEP_OK, "a batch is not freed as a plan");
  lockstep_batch_free(next);
  lockstep_settings_init(NULL);
  lockstep_options_init(NULL);
  lockstep_root_noise_init(NULL);
  lockstep_pose_noise_init(NULL);
  lockstep_randomization_init(NULL);
  lockstep_action_map_init(NULL);
  lockstep_rollout_options_init(NULL);
}

/* Three rollouts of four control steps from environment 0, against the same steps. */
static void roll_out(const lockstep_plan* plan, int32_t knuckle) {
  lockstep_options options;
  lockstep_rollout_options rollout;
  lockstep_batch* one = NULL;
  lockstep_batch* two = NULL;
  lockstep_query query;
  lockstep_records controls, out;
  lockstep_array actions, positions;
  float inputs[3 * 4], results[3 * 4];
  uint32_t faults[3];
  uint64_t bytes = 0;
  void* start;
  int i, t;
  lockstep_options_init(&options);
  options.threads = 1;
  lockstep_batch_new(plan, &options, &one);
  options.environments = 2;
  lockstep_batch_new(plan, &options, &two);
  lockstep_save(one, NULL, &bytes);
  start = malloc((size_t)bytes);
  lockstep_save(one, start, &bytes);
  for (i = 0; i < 12; ++i) inputs[i] = 0.1f * (float)(i % 7) - 0.2f;
  controls = records_of(inputs, 3, 4, 1);
  out = records_of(results, 3, 4, 1);
  query = query_of(LOCKSTEP_READ_POSITION, knuckle);
  lockstep_rollout_options_init(&rollout);
  rollout.substeps = 3;
  faults[2] = 9;
  expect(lockstep_rollout(two, start, bytes, &rollout, &controls, &query, 1, &out, faults) == LOCKSTEP_OK,
         "rollouts must run");
  expect(faults[0] == 0 && faults[2] == 0, "without faults");
  lockstep_field(one, LOCKSTEP_POSITIONS, &positions);
  for (i = 0; i < 3; ++i) {
    lockstep_restore(one, start, bytes);
    for (t = 0; t < 4; ++t) {
      actions = rows_of(inputs + 4 * i + t, 1, 1);
      lockstep_act(one, &actions);
      lockstep_step(one, 3);
      expect(*at(&positions, knuckle, 0) == results[4 * i + t], "a rollout takes the steps of lockstep_step()");
    }
  }
  expect(lockstep_rollout(two, NULL, 0, &rollout, &controls, &query, 1, &out, NULL) == LOCKSTEP_USAGE_ERROR,
         "without a start there is a rollout for each environment");
  out.shape[1] = 5;
  expect(lockstep_rollout(two, start, bytes, &rollout, &controls, &query, 1, &out, NULL) == LOCKSTEP_USAGE_ERROR,
         "shapes must fit");
  expect(lockstep_rollout(two, start, bytes, &rollout, NULL, NULL, 0, NULL, NULL) == LOCKSTEP_USAGE_ERROR,
         "controls must be given");
  free(start);
  lockstep_batch_free(one);
  lockstep_batch_free(two);
}

/* v = J z and 2 T = z M z, of one environment that moves. */
static void read_matrices(const lockstep_plan* plan, lockstep_batch* batch) {
  lockstep_array out, velocities, read;
  lockstep_query query;
  float matrix[16], jacobian[24], forces[4], twist[64 * 6], energy[64];
  double z[4], twice = 0.0, sum;
  unsigned char mask[64];
  const char* name;
  int64_t n = 0, links = 0, dof = 0;
  int i, k;
  expect(lockstep_plan_count(plan, LOCKSTEP_COORDINATES, &n) == LOCKSTEP_OK && n == 4, "four joints are coordinates");
  expect(lockstep_plan_count(plan, LOCKSTEP_LINKS, &links) == LOCKSTEP_OK, "there are links");
  memset(mask, 0, sizeof mask);
  mask[5] = 1;
  lockstep_field(batch, LOCKSTEP_VELOCITIES, &velocities);
  for (i = 0; i < 4; ++i) {
    lockstep_plan_name(plan, LOCKSTEP_COORDINATES, i, &name);
    lockstep_plan_index(plan, LOCKSTEP_DOFS, name, &dof);
    z[i] = 0.3 * (i + 1);
    *at(&velocities, (long)dof, 5) = (float)z[i];
  }
  lockstep_project(batch, NULL, 0);
  out = rows_of(matrix, 16, 1);
  expect(lockstep_mass_matrix(batch, mask, 64, &out) == LOCKSTEP_OK, "a mass matrix must be read");
  out = rows_of(forces, 4, 1);
  expect(lockstep_bias_forces(batch, mask, 64, &out) == LOCKSTEP_OK, "bias forces must be read");
  expect(lockstep_bias_forces(batch, NULL, 0, &out) == LOCKSTEP_USAGE_ERROR, "of all there are more");
  out = rows_of(jacobian, 24, 1);
  expect(lockstep_jacobian(batch, LOCKSTEP_LINKS, links - 1, mask, 64, &out) == LOCKSTEP_OK, "a Jacobian must be read");
  expect(lockstep_jacobian(batch, LOCKSTEP_LINKS, links, mask, 64, &out) == LOCKSTEP_USAGE_ERROR,
         "links must be known");
  expect(lockstep_jacobian(batch, LOCKSTEP_ROOTS, 0, mask, 64, &out) == LOCKSTEP_USAGE_ERROR, "roots have none");
  query = query_of(LOCKSTEP_READ_LINK_VELOCITY, (int32_t)links - 1);
  read = rows_of(twist, 6, 64);
  lockstep_read(batch, &query, 1, &read);
  query.quantity = LOCKSTEP_READ_KINETIC_ENERGY;
  query.row = -1;
  read = rows_of(energy, 1, 64);
  lockstep_read(batch, &query, 1, &read);
  for (i = 0; i < 6; ++i) {
    sum = 0.0;
    for (k = 0; k < 4; ++k) sum += (double)jacobian[6 * k + i] * z[k];
    expect(fabs(sum - (double)twist[64 * i + 5]) < 1e-5, "the Jacobian gives the velocity of the link");
  }
  for (i = 0; i < 4; ++i)
    for (k = 0; k < 4; ++k) twice += z[i] * (double)matrix[4 * i + k] * z[k];
  expect(twice > 0.0 && fabs(twice / 2.0 / (double)energy[5] - 1.0) < 1e-4, "the mass matrix gives the energy");
}

/* A box falls on the ground of a file, and through it where colliders are not asked for. */
static void touch(void) {
  lockstep_model* model = NULL;
  lockstep_plan* plan = NULL;
  lockstep_batch* batch = NULL;
  lockstep_settings settings;
  lockstep_options options;
  lockstep_query query;
  lockstep_array poses, read;
  float forces[3];
  int colliders;
  FILE* file = fopen("box.xml", "w");
  if (!file) {
    expect(0, "box.xml must be written");
    return;
  }
  fputs("<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 0.15'><freejoint/>"
        "<geom type='box' size='0.1 0.1 0.1' mass='2'/></body></worldbody></mujoco>",
        file);
  fclose(file);
  lockstep_settings_init(&settings);
  lockstep_options_init(&options);
  options.threads = 1;
  for (colliders = 0; colliders < 2; ++colliders) {
    expect(lockstep_model_from_file("box.xml", NULL, NULL, colliders ? LOCKSTEP_COLLIDERS : 0, &model) == LOCKSTEP_OK,
           "the box must be read");
    expect(lockstep_compile(model, &settings, &plan) == LOCKSTEP_OK, "and compile");
    expect(lockstep_batch_new(plan, &options, &batch) == LOCKSTEP_OK, "and have a batch");
    lockstep_step(batch, 240);
    expect(lockstep_field(batch, LOCKSTEP_ROOT_POSES, &poses) == LOCKSTEP_OK, "it floats");
    if (colliders) {
      expect(fabs((double)*at(&poses, 2, 0) - 0.1) < 1e-3, "a box with colliders lies on the ground");
      query = query_of(LOCKSTEP_READ_LINK_CONTACT_FORCE, 0);
      read = rows_of(forces, 3, 1);
      expect(lockstep_read(batch, &query, 1, &read) == LOCKSTEP_OK && fabs((double)forces[2] - 2.0 * 9.81) < 0.05,
             "which carries its weight");
    } else {
      expect(*at(&poses, 2, 0) < -1.0f, "a box without colliders falls");
    }
    lockstep_batch_free(batch);
    lockstep_plan_free(plan);
    lockstep_model_free(model);
  }
  remove("box.xml");
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
  expect(lockstep_model_from_file(arguments[1], NULL, "", 16, &model) == LOCKSTEP_USAGE_ERROR, "flags must be known");
  expect(lockstep_model_from_file(arguments[1], NULL, "", 0, &model) == LOCKSTEP_OK, "any file must be read");
  lockstep_model_free(model);
  expect(lockstep_model_from_urdf(arguments[1], &model) == LOCKSTEP_OK, "the gripper must be read");
  expect(lockstep_model_set_drive(model, "knuckle", 8.0, 0.3) == LOCKSTEP_OK, "the knuckle must take a drive");
  expect(lockstep_model_report(model, &text) == LOCKSTEP_OK && strstr(text, "5 couplings") != NULL,
         "there is a report");
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
  query = query_of(LOCKSTEP_READ_COUPLING_ERROR, -1);
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
  expect(lockstep_reset_mask(batch, mask, 64, 0xff) == LOCKSTEP_USAGE_ERROR && strstr(lockstep_message(), "255") != NULL,
         "unknown flags must be refused, and named");
  expect(lockstep_reset_mask(batch, mask, -1, 0) == LOCKSTEP_USAGE_ERROR, "a negative length must be refused");
  expect(lockstep_reset_ids(batch, NULL, -1, 0) == LOCKSTEP_USAGE_ERROR, "here, too");
  expect(lockstep_plan_index(plan, LOCKSTEP_ROOTS, NULL, &dofs) == LOCKSTEP_USAGE_ERROR, "a name must be given");
  query.row = -7;
  expect(lockstep_read(batch, &query, 1, &errors) == LOCKSTEP_USAGE_ERROR, "rows are -1 or more");
  expect(lockstep_step(NULL, 1) == LOCKSTEP_USAGE_ERROR, "null is refused");

  act(batch, (int32_t)knuckle);
  read_matrices(plan, batch);
  roll_out(plan, (int32_t)knuckle);
  touch();

  lockstep_batch_free(batch);
  expect_no_object(plan, batch);
  lockstep_plan_free(plan);
  lockstep_plan_free(NULL);
  printf("%d failures\n", failures);
  return failures != 0;
}
