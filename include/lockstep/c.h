/* The C interface of lockstep. SPDX-License-Identifier: Apache-2.0
 *
 * Functions return LOCKSTEP_OK or the kind of failure; lockstep_message() has the words. No exception leaves them.
 * Structs begin with their size. Those that have an _init function may have more members in later versions: call it
 * first. lockstep_array and lockstep_query stay as they are. Members and flags that are not listed are 0.
 * Objects belong to the caller, who frees them. Arrays belong to their batch. Pointers to objects are handles: one that
 * was freed, one of another kind, or another pointer is a LOCKSTEP_USAGE_ERROR.
 *
 * Promise: a program that was compiled with a version of the library runs with all later ones of the same number
 * lockstep_abi(). Within it functions and members are added, not changed.
 *
 * Threads: models and plans may be shared. The functions of one batch must not run at the same time. */
#ifndef LOCKSTEP_C_H
#define LOCKSTEP_C_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LOCKSTEP_C_API __attribute__((visibility("default")))

/* --- failures ----------------------------------------------------------------------------------------------------- */

enum {
  LOCKSTEP_OK = 0,
  LOCKSTEP_MODEL_ERROR = 1,    /* the mechanism is impossible or incomplete, or lacks what was named */
  LOCKSTEP_IMPORT_ERROR = 2,   /* a file cannot be read as a mechanism */
  LOCKSTEP_SETTINGS_ERROR = 3, /* a setting is out of its range, or does not apply */
  LOCKSTEP_USAGE_ERROR = 4,    /* an index, a name, a size or a null pointer is wrong, or a batch is in use */
  LOCKSTEP_MEMORY_ERROR = 5,
  LOCKSTEP_INTERNAL_ERROR = 6 /* a bug of the library */
};

/* 1. */
LOCKSTEP_C_API int lockstep_abi(void);
/* "major.minor.patch" */
LOCKSTEP_C_API const char* lockstep_version(void);
/* "element: rule; remedy" of this thread's last failure, of a file a line for each reason; "" before there was
   one. Valid until the next failure. */
LOCKSTEP_C_API const char* lockstep_message(void);
/* Its code, such as "model.joint" or "memory", "" before there was a failure: docs/errors.md. It stays the same when
 * the words change. The string lives forever. */
LOCKSTEP_C_API const char* lockstep_code(void);
/* The code of a number of lockstep_faults(), such as "fault.not_finite"; "" for 0 and for what is no fault. */
LOCKSTEP_C_API const char* lockstep_fault_code(uint32_t fault);

/* --- models and plans --------------------------------------------------------------------------------------------- */

typedef struct lockstep_model lockstep_model;
typedef struct lockstep_plan lockstep_plan;
typedef struct lockstep_batch lockstep_batch;

LOCKSTEP_C_API int lockstep_model_from_urdf(const char* path, lockstep_model** out);
LOCKSTEP_C_API int lockstep_model_from_urdf_text(const char* text, lockstep_model** out);
/* What becomes of a file: bits of `flags`, as Loops, ImportOptions::leave_out_meshes, Soft and ImportOptions::colliders
 * in import.h. Colliders of MJCF touch what the file lets them; those of URDF touch nothing. */
enum {
  LOCKSTEP_LEAVE_OUT_LOOPS = 1,
  LOCKSTEP_LEAVE_OUT_MESHES = 2,
  LOCKSTEP_SOFT_AS_IN_FILE = 4,
  LOCKSTEP_COLLIDERS = 8
};
/* Reads URDF or MJCF, whichever the root element says it is. For MJCF, `keyframe` is the key to start in and `body` the
 * one to read with what it carries; null or "" takes the drawn pose and all bodies. */
LOCKSTEP_C_API int lockstep_model_from_file(const char* path, const char* keyframe, const char* body, uint32_t flags,
                                            lockstep_model** out);
/* What became of everything in the file, line by line; lines of what its owner should act on begin with "warning: ". It
 * lives as long as the model. */
LOCKSTEP_C_API int lockstep_model_report(const lockstep_model* model, const char** out);
/* Writes a file: URDF where its name ends with .urdf, MJCF where it ends with .xml or .mjcf, for a step of MuJoCo of
 * `timestep` s, > 0, or 0 for that of the file that was read, 0.001 if it had none. The report names what the format
 * cannot say; it is valid until this thread's next export, and may be null. */
LOCKSTEP_C_API int lockstep_model_export(const lockstep_model* model, const char* path, double timestep,
                                         const char** report);
/* What moves a joint: kp in N m/rad or N/m, kd in N m s/rad or N s/m, both >= 0. */
LOCKSTEP_C_API int lockstep_model_set_drive(lockstep_model* model, const char* joint, double kp, double kd);
/* A frame on a link: x, y, z in m, quaternion w, x, y, z, in the link's axes. */
LOCKSTEP_C_API int lockstep_model_add_site(lockstep_model* model, const char* name, const char* link,
                                           const double pose[7]);
LOCKSTEP_C_API void lockstep_model_free(lockstep_model* model); /* null is fine here, as in all _free and _init */

/* Numbers of fields that may differ per environment, as in enums.h: bits of lockstep_settings.per_environment, and
 * LOCKSTEP_PARAMETER + number is a field of a batch. */
enum {
  LOCKSTEP_GEAR_RATIO = 0,
  LOCKSTEP_OFFSET = 1,
  LOCKSTEP_SOFTNESS = 2,
  LOCKSTEP_DRIVE_GAINS = 3,
  LOCKSTEP_DAMPING = 4,
  LOCKSTEP_MASS = 5,
  LOCKSTEP_GRAVITY = 6,
  LOCKSTEP_LINK_WRENCH = 7,
  LOCKSTEP_COUPLING_SWITCH = 8,
  LOCKSTEP_ARMATURE = 9,
  LOCKSTEP_STIFFNESS = 10,
  LOCKSTEP_FRICTION = 11,
  LOCKSTEP_POSITION_LIMITS = 12,
  LOCKSTEP_VELOCITY_LIMIT = 13,
  LOCKSTEP_EFFORT_LIMIT = 14,
  LOCKSTEP_CENTER_OF_MASS = 15,
  LOCKSTEP_INERTIA = 16,
  LOCKSTEP_CONTACT_FRICTION = 17,
  LOCKSTEP_LOOP_SWITCH = 18,
  LOCKSTEP_LOOP_FRAME = 19,
  LOCKSTEP_FUNCTION = 20,
  LOCKSTEP_DRIVE_DELAY = 21,
  LOCKSTEP_DRIVE_LAG = 22,
  LOCKSTEP_MOTOR_CURVE = 23,
  LOCKSTEP_COLLIDER_PLACE = 24,
  LOCKSTEP_COLLIDER_SIZE = 25,
  LOCKSTEP_CONTACT_RESTITUTION = 26
};

typedef struct {
  uint32_t size;
  uint32_t per_environment; /* 1u << LOCKSTEP_MASS | ... */
  double dt;                /* s */
  double guard;             /* see StepSettings::guard */
  const char* method;       /* "automatic", "pgs", "tgs", "direct", "reduced" */
  const char* integrator;   /* "automatic", "euler", "leapfrog", "extrapolated", "runge_kutta" */
  int32_t iterations;
  int32_t velocity_iterations;
  int32_t stage_inputs;    /* 0 or 1, as the next five */
  int32_t record_impulses; /* read in C++ and Python alone, as diagnostics are */
  int32_t record_diagnostics;
  int32_t record_efforts;
  int32_t record_contacts;
  int32_t record_accelerations;
} lockstep_settings;

LOCKSTEP_C_API void lockstep_settings_init(lockstep_settings* settings);
/* settings: null for the defaults. */
LOCKSTEP_C_API int lockstep_compile(const lockstep_model* model, const lockstep_settings* settings,
                                    lockstep_plan** out);
LOCKSTEP_C_API void lockstep_plan_free(lockstep_plan* plan);

/* Lists of a plan. */
enum {
  LOCKSTEP_DOFS = 0,        /* moving joints, in the order of positions */
  LOCKSTEP_INDEPENDENT = 1, /* those that couplings leave free */
  LOCKSTEP_DRIVEN = 2,      /* joints, followers and tendons with a drive: the rows of actions */
  LOCKSTEP_COUPLINGS = 3,
  LOCKSTEP_LINKS = 4,
  LOCKSTEP_SITES = 5,
  LOCKSTEP_ROOTS = 6,      /* floating ones */
  LOCKSTEP_POSES = 7,      /* to start in: keyframes of MJCF */
  LOCKSTEP_COORDINATES = 8 /* dofs that no hard coupling places: rows of mass matrices behind the roots' six */
};
LOCKSTEP_C_API int lockstep_plan_count(const lockstep_plan* plan, int list, int64_t* out);
/* The name lives as long as the plan. */
LOCKSTEP_C_API int lockstep_plan_name(const lockstep_plan* plan, int list, int64_t index, const char** out);
/* The dof, link, site ... of that name: its index in LOCKSTEP_DOFS, LOCKSTEP_LINKS or LOCKSTEP_SITES. */
LOCKSTEP_C_API int lockstep_plan_index(const lockstep_plan* plan, int list, const char* name, int64_t* out);
/* In words: what a step does. The string lives as long as the plan. */
LOCKSTEP_C_API int lockstep_plan_describe(lockstep_plan* plan, const char** out);

/* --- batches ------------------------------------------------------------------------------------------------------ */

typedef struct {
  uint32_t size;
  uint32_t first_id; /* environments have the ids first_id, first_id + 1 ... */
  uint64_t seed;     /* of random numbers */
  int64_t environments;
  int32_t threads;   /* 1: the calling one; 0: as many as the process may use */
  int32_t precision; /* 32 or 64 */
} lockstep_options;

LOCKSTEP_C_API void lockstep_options_init(lockstep_options* options);
LOCKSTEP_C_API int lockstep_batch_new(const lockstep_plan* plan, const lockstep_options* options, lockstep_batch** out);
LOCKSTEP_C_API void lockstep_batch_free(lockstep_batch* batch);

enum { LOCKSTEP_F32 = 0, LOCKSTEP_F64 = 1, LOCKSTEP_U32 = 2, LOCKSTEP_U64 = 3 };
enum { LOCKSTEP_READ_ONLY = 1 };

/* Numbers in memory: element [i][k] is at data + i * stride[0] + k * stride[1]; strides in bytes. */
typedef struct {
  uint32_t size;
  uint32_t flags; /* LOCKSTEP_READ_ONLY */
  void* data;
  int32_t type; /* LOCKSTEP_F32 ... */
  int32_t rank; /* 2 */
  int64_t shape[2];
  int64_t stride[2];
} lockstep_array;

enum {
  LOCKSTEP_POSITIONS = 0,        /* [dofs][environments] rad or m */
  LOCKSTEP_VELOCITIES = 1,       /* rad/s or m/s */
  LOCKSTEP_POSITION_TARGETS = 2, /* for joints with a drive */
  LOCKSTEP_VELOCITY_TARGETS = 3,
  LOCKSTEP_EFFORTS = 4,         /* feed-forward, N m or N */
  LOCKSTEP_ROOT_POSES = 5,      /* [7 roots][environments] x, y, z, quaternion w, x, y, z */
  LOCKSTEP_ROOT_VELOCITIES = 6, /* [6 roots][environments] angular, linear, in the root's axes */
  LOCKSTEP_FAULTS = 7,          /* [1][environments] 0, or why the environment is frozen; read-only */
  LOCKSTEP_STEPS = 8,           /* since the last reset; read-only */
  LOCKSTEP_EPISODES = 9,        /* how often it was reset */
  LOCKSTEP_IDS = 10,
  LOCKSTEP_SEEDS = 11,
  LOCKSTEP_PARAMETER = 100 /* + the number of a field that was declared */
};
/* The live array of a field: valid until lockstep_batch_free(), edits need no announcement. */
LOCKSTEP_C_API int lockstep_field(lockstep_batch* batch, int field, lockstep_array* out);

/* substeps >= 1 steps of dt. Allocates nothing with one thread. A bad environment is frozen; see LOCKSTEP_FAULTS. */
LOCKSTEP_C_API int lockstep_step(lockstep_batch* batch, int32_t substeps);

enum { LOCKSTEP_KEEP_INPUTS = 1 };
/* To the model's state: those with a 1 in the mask (n = environments), or those listed; null with 0 is all. Flags:
 * LOCKSTEP_KEEP_INPUTS. */
LOCKSTEP_C_API int lockstep_reset_mask(lockstep_batch* batch, const uint8_t* mask, int64_t n, uint32_t flags);
LOCKSTEP_C_API int lockstep_reset_ids(lockstep_batch* batch, const int32_t* ids, int64_t n, uint32_t flags);
/* What is random of a floating root, as RootNoise of lockstep/batch.h. link: null for all that no other names. */
typedef struct {
  uint32_t size;
  int32_t any_rotation; /* 0 or 1 */
  const char* link;
  double position[3];
  double yaw;
  double angular_velocity, linear_velocity;
} lockstep_root_noise;
LOCKSTEP_C_API void lockstep_root_noise_init(lockstep_root_noise* noise);
/* What is random of a start, as PoseNoise. */
typedef struct {
  uint32_t size;
  uint32_t stream;
  double position, spread, velocity;
  const lockstep_root_noise* roots; /* as many, or null */
  int64_t root_count;
  uint32_t flags;   /* LOCKSTEP_KEEP_INPUTS */
  int32_t reserved; /* 0 */
} lockstep_pose_noise;
LOCKSTEP_C_API void lockstep_pose_noise_init(lockstep_pose_noise* noise);
/* To a pose, a name of LOCKSTEP_POSES, or null for the model's own start. noise: null for none. */
LOCKSTEP_C_API int lockstep_reset_to(lockstep_batch* batch, const char* pose, const lockstep_pose_noise* noise,
                                     const uint8_t* mask, int64_t n);
/* From the model's own start: see Batch::reset_random(). */
LOCKSTEP_C_API int lockstep_reset_random(lockstep_batch* batch, const uint8_t* mask, int64_t n, double spread,
                                         double speed);
/* Makes environments equal to `from`, but for their ids, seeds and episodes: see Batch::copy(). */
LOCKSTEP_C_API int lockstep_copy(lockstep_batch* batch, int64_t from, const uint8_t* mask, int64_t n);
/* Puts followers where the other joints put them. */
LOCKSTEP_C_API int lockstep_project(lockstep_batch* batch, const uint8_t* mask, int64_t n);

enum { LOCKSTEP_SCALE = 0, LOCKSTEP_ADD = 1, LOCKSTEP_ABSOLUTE = 2 };
enum { LOCKSTEP_UNIFORM = 0, LOCKSTEP_LOG_UNIFORM = 1, LOCKSTEP_NORMAL = 2 };
typedef struct {
  uint32_t size;
  int32_t parameter;    /* LOCKSTEP_MASS ... */
  int32_t operation;    /* LOCKSTEP_SCALE ... on the compiled values */
  int32_t distribution; /* LOCKSTEP_UNIFORM ... */
  double low, high;     /* LOCKSTEP_NORMAL: mean and standard deviation */
  uint32_t stream;
  int32_t shared; /* 1: one number for all rows */
} lockstep_randomization;
LOCKSTEP_C_API void lockstep_randomization_init(lockstep_randomization* randomization);
LOCKSTEP_C_API int lockstep_randomize(lockstep_batch* batch, const lockstep_randomization* randomization,
                                      const uint8_t* mask, int64_t n);

/* Actions in [-1, 1], [driven][environments] by the array's strides, become position targets within the ranges. */
LOCKSTEP_C_API int lockstep_act(lockstep_batch* batch, const lockstep_array* actions);

enum {
  LOCKSTEP_ACT_POSITION = 0,
  LOCKSTEP_ACT_POSITION_CHANGE = 1,
  LOCKSTEP_ACT_VELOCITY = 2,
  LOCKSTEP_ACT_EFFORT = 3
};
/* What actions mean, as ActionMap of lockstep/actions.h. Lists have `count` numbers, one by action; null: absent. */
typedef struct {
  uint32_t size;
  int32_t kind;        /* LOCKSTEP_ACT_POSITION ... */
  const int32_t* dofs; /* numbers of LOCKSTEP_DOFS; null: all of LOCKSTEP_DRIVEN, of LOCKSTEP_INDEPENDENT for efforts */
  const double* low;   /* -1 is low and 1 is high */
  const double* high;
  const double* scale; /* or center + scale times the action */
  const double* center;
  int64_t count;    /* actions of an environment; 0 where all lists are null */
  double alpha;     /* share of the new value in a moving average, in (0, 1] */
  int32_t raw;      /* 1: actions are rad, m, rad/s, N m ... themselves */
  int32_t reserved; /* 0 */
} lockstep_action_map;
LOCKSTEP_C_API void lockstep_action_map_init(lockstep_action_map* map);
/* Actions [count][environments] of the environments of the mask become targets or efforts; others' are not read. An
 * environment with a NaN among its actions gets a fault. map: null for the default, as in lockstep_act(). */
LOCKSTEP_C_API int lockstep_act_as(lockstep_batch* batch, const lockstep_action_map* map, const lockstep_array* actions,
                                   const uint8_t* mask, int64_t n);

enum {
  LOCKSTEP_READ_POSITION = 0,
  LOCKSTEP_READ_VELOCITY = 1,
  LOCKSTEP_READ_POSITION_TARGET = 2,
  LOCKSTEP_READ_LINK_POSE = 3,     /* 7 rows */
  LOCKSTEP_READ_LINK_VELOCITY = 4, /* 6 rows */
  LOCKSTEP_READ_SITE_POSE = 5,
  LOCKSTEP_READ_SITE_POSITION = 6, /* 3 rows */
  LOCKSTEP_READ_SITE_VELOCITY = 7,
  LOCKSTEP_READ_COUPLING_ERROR = 8,
  LOCKSTEP_READ_KINETIC_ENERGY = 9,
  LOCKSTEP_READ_POTENTIAL_ENERGY = 10,
  LOCKSTEP_READ_CONTACT_FORCE = 11, /* 3 rows, on the second collider of a pair, world axes */
  LOCKSTEP_READ_CONTACT_NORMAL_FORCE = 12,
  LOCKSTEP_READ_CONTACT_GAP = 13,
  LOCKSTEP_READ_CONTACT_SLIP = 14,
  LOCKSTEP_READ_CONTACT_POINT = 15, /* 11 rows by slot: point, normal, force, gap, speed along the surface */
  LOCKSTEP_READ_UNFINISHED_CONTACTS = 16,
  LOCKSTEP_READ_SOLVE_COUNTS = 17,       /* 11 rows: what the last call of step has spent on contacts, see query.h */
  LOCKSTEP_READ_LOOP_ERROR = 18,         /* 2 rows by loop: distance, angle */
  LOCKSTEP_READ_LOOP_FORCE = 19,         /* 6 rows by loop: force, torque on the second link, world axes */
  LOCKSTEP_READ_LINK_TWIST = 20,         /* 6 rows: the velocity in the link's axes */
  LOCKSTEP_READ_SITE_TWIST = 21,         /* 6 rows: the same in the site's axes */
  LOCKSTEP_READ_LINK_GRAVITY = 22,       /* 3 rows: unit vector along gravity in the link's axes */
  LOCKSTEP_READ_SITE_GRAVITY = 23,       /* 3 rows: the same in the site's axes */
  LOCKSTEP_READ_LINK_CONTACT_FORCE = 24, /* 3 rows: the sum of the contact forces on the link, world axes */
  LOCKSTEP_READ_LINK_CONTACTS = 25,      /* how many pairs with the link bear a force */
  LOCKSTEP_READ_DRIVE_EFFORT = 26,       /* this and the next two need lockstep_settings.record_efforts */
  LOCKSTEP_READ_DRIVE_EFFORT_PEAK = 27,
  LOCKSTEP_READ_DRIVE_EFFORT_MEAN = 28,
  LOCKSTEP_READ_CONTACT_PEAK_FORCE = 29, /* this and the next ones need lockstep_settings.record_contacts */
  LOCKSTEP_READ_CONTACT_MEAN_FORCE = 30, /* 3 rows */
  LOCKSTEP_READ_CONTACT_TIME = 31,
  LOCKSTEP_READ_CONTACT_AIR_TIME = 32,
  LOCKSTEP_READ_CONTACT_LAST_TIME = 33,
  LOCKSTEP_READ_CONTACT_LAST_AIR_TIME = 34,
  LOCKSTEP_READ_CONTACT_FIRST_TOUCH = 35,
  LOCKSTEP_READ_JOINT_ACCELERATION = 36, /* this and the next ones need lockstep_settings.record_accelerations */
  LOCKSTEP_READ_LINK_ACCELERATION = 37,  /* 6 rows */
  LOCKSTEP_READ_SITE_ACCELERATION = 38,  /* 6 rows */
  LOCKSTEP_READ_JOINT_WRENCH = 39        /* 6 rows */
};
typedef struct {
  uint32_t size;
  int32_t quantity; /* LOCKSTEP_READ_POSITION ... */
  int32_t row;      /* dof, link, site, pair or slot; -1 is all of them */
  int32_t reserved; /* 0 */
  double scale;
} lockstep_query;
/* Fills out, [rows of all queries][environments] by its strides, with the batch's precision. */
LOCKSTEP_C_API int lockstep_read(lockstep_batch* batch, const lockstep_query* queries, int64_t count,
                                 const lockstep_array* out);

/* In independent coordinates: the six velocities of each floating root, then LOCKSTEP_COORDINATES; n in all. Columns of
 * `out` are the environments of the mask, in their order. Loops are open. See Batch::mass_matrices(). */
LOCKSTEP_C_API int lockstep_mass_matrix(lockstep_batch* batch, const uint8_t* mask, int64_t length,
                                        const lockstep_array* out); /* [n n] row n i + k */
/* Gravity, Coriolis and centrifugal forces. */
LOCKSTEP_C_API int lockstep_bias_forces(lockstep_batch* batch, const uint8_t* mask, int64_t length,
                                        const lockstep_array* out); /* [n] */
/* Angular, then linear velocity of a link or a site in world axes, by coordinate. list: LOCKSTEP_LINKS, LOCKSTEP_SITES.
 */
LOCKSTEP_C_API int lockstep_jacobian(lockstep_batch* batch, int list, int64_t index, const uint8_t* mask,
                                     int64_t length, const lockstep_array* out); /* [6 n] row 6 k + component */

/* Everything that the next steps depend on. `to` null: only *bytes is set. *bytes: in, what there is room for; out,
 * what it takes. */
LOCKSTEP_C_API int lockstep_save(const lockstep_batch* batch, void* to, uint64_t* bytes);
/* Into all environments of a batch of the same size and plan; they go on with the same bits. */
LOCKSTEP_C_API int lockstep_restore(lockstep_batch* batch, const void* from, uint64_t bytes);

/* Numbers of rollouts: number [i][t][k] of rollout i and control step t is at data + i * stride[0] + t * stride[1] +
 * k * stride[2]; strides in bytes, the batch's precision. */
typedef struct {
  uint32_t size;
  int32_t type; /* LOCKSTEP_F32 or LOCKSTEP_F64 */
  void* data;
  int64_t shape[3];
  int64_t stride[3];
} lockstep_records;
typedef struct {
  uint32_t size;
  int32_t substeps;               /* steps of dt in a control step, >= 1 */
  const lockstep_action_map* map; /* null for the default */
} lockstep_rollout_options;
LOCKSTEP_C_API void lockstep_rollout_options_init(lockstep_rollout_options* options);
/* Rollouts of controls [rollouts][steps][actions], from a blob of lockstep_save() of a batch of the same plan with one
 * environment or one for each rollout; null with 0 bytes: each from its environment as it stands. Writes the rows of
 * the queries to out, [rollouts][steps][rows], null without queries, and the fault of each rollout to `faults`, which
 * may be null. The batch is the workspace: its environments are overwritten. See Batch::rollout(). */
LOCKSTEP_C_API int lockstep_rollout(lockstep_batch* batch, const void* from, uint64_t bytes,
                                    const lockstep_rollout_options* options, const lockstep_records* controls,
                                    const lockstep_query* queries, int64_t count, const lockstep_records* out,
                                    uint32_t* faults);

/* The fault of an environment in words, into text of that size, cut off if it does not fit. */
LOCKSTEP_C_API int lockstep_explain_fault(const lockstep_batch* batch, int64_t environment, char* text, uint64_t size);

#ifdef __cplusplus
}
#endif
#endif
