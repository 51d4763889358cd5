// Reading a mechanism from a robot file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "lockstep/model.h"
#include "lockstep/step.h"

namespace lockstep {

/// What a link looks like, for pages alone.
struct VisualMesh {
  std::string link;
  Eigen::Matrix3Xf vertices;   ///< m, in the link's frame
  Eigen::Matrix3Xi triangles;  ///< numbers of three vertices, to the left as seen from outside
};

/// A Model and what became of everything else in the file.
struct Import {
  Model model;
  /// One line per kind of thing: what was read, what was changed (mimics of mimics are resolved), and what was left out
  /// (visual, collision, transmission, ...). Nothing is left out silently.
  std::vector<std::string> report;
  /// The lines of the report that the file's owner should act on: followers whose limits leave their leader no room,
  /// joints that start outside of their limits, changed inertias, unknown elements, what was left out on request.
  std::vector<std::string> warnings;
  std::vector<VisualMesh> visual_meshes;  ///< where ImportOptions::visual_meshes asks for them
  /// What it was read from: the robot file, what that includes and attaches, meshes and height fields. Each once.
  std::vector<std::string> files;
};

/// What becomes of closed loops of an MJCF file: connect and weld.
enum class Loops {
  keep,       ///< they become Model::loops
  leave_out,  ///< the trees are read without them; the report names each
};

/// What becomes of the softness that MuJoCo gives to all couplings and loops.
enum class Soft {
  harden,      ///< they are hard; the report names their softness
  as_in_file,  ///< a Frequency that sags as MuJoCo's does. It rings faster: MuJoCo's yields by a virtual mass, too
};

/// What touches in place of a mesh.
enum class Fit {
  hull,     ///< its convex hull, of at most ImportOptions::hull_vertices corners
  box,      ///< around the hull, along its principal axes
  capsule,  ///< likewise; a sphere where that is as good
  none,     ///< nothing: the mesh is not opened, and the report names it
};

LOCKSTEP_API const char* to_string(Loops loops);
LOCKSTEP_API const char* to_string(Soft soft);
LOCKSTEP_API const char* to_string(Fit fit);

/// What to do where a file leaves out inertias, has impossible ones, or holds what lockstep does not have. By default
/// nothing is repaired or left out: a body whose joint has no inertia to move, or whose inertia no body can have, is an
/// error. The report names every link that was changed. A body is a moving link, or the root, with all links fixed to
/// it; a tensor is judged and repaired as part of its body.
struct ImportOptions {
  /// kg, >= 0. Raises the masses of lighter bodies; MuJoCo's boundmass. With this or the next bound, impossible
  /// inertias are repaired, too.
  double least_mass = 0.0;
  /// kg m^2, >= 0. Raises smaller principal moments of bodies with mass; MuJoCo's boundinertia.
  double least_inertia = 0.0;
  /// URDF only. kg/m^3, >= 0. Above 0, bodies without mass and inertia get those of their collision shapes, and an
  /// <inertial> without <inertia> or <mass> gets what it lacks from them. Shapes that overlap count twice. A mesh that
  /// is not closed counts as its hull.
  double density = 0.0;
  /// Collision shapes become colliders of the group "robot", named after their links. Those of URDF touch nothing until
  /// Model::contacts says so. MJCF's geoms touch what the file lets them. Of a mesh its hull touches, or what `fit`
  /// says; the report names corners that are lost, and hollows that are filled.
  bool colliders = false;
  /// MJCF only. What one child of the world carries may touch itself, where the file lets it. Hulls of links that are
  /// neighbours but one often overlap for good.
  bool self_collisions = true;
  /// Corners that the hull of a mesh may have, 8 to 64. More cost time: one of 64 about 1.4 times one of 32.
  int hull_vertices = 64;
  Fit fit = Fit::hull;
  std::map<std::string, Fit> fit_of_links = {};  ///< in place of `fit`, by name; MJCF calls links bodies
  /// Folders of packages by name, for package://name/path. By default it is the nearest folder of that name among those
  /// around the robot file and beside them.
  std::map<std::string, std::string> packages = {};
  /// Folders that meshes and included files may lie in, beside that of the robot file and those of packages. Files
  /// elsewhere are not opened, whatever leads there.
  std::vector<std::string> file_roots = {};
  /// An inertia that no body can have becomes the nearest that one can have, in the (Frobenius) norm of the tensor.
  bool repair_inertias = false;
  /// Bounds that are not judged. They stay in the Model if they are possible, so give StepSettings::ignore the same.
  /// Followers are the joints with a <mimic>. Names must be those of moving joints.
  Ignored ignore = {};
  /// URDF only. Leaves out closed loops, couplings and joints that other tools add to URDF, and joints whose child
  /// another joint carries already. By default they are errors, but for a <loop_joint>, which is read.
  bool leave_out_foreign = false;
  /// MJCF only. The <key> that the Model starts in, by its name, or by its number from 0 where no key has that name.
  /// Empty: the pose that the file draws, at rest, with servos that hold it.
  std::string keyframe = {};
  /// MJCF only. Reads this body and what it carries, and leaves out all else. It stands where the file draws it.
  std::string body = {};
  Loops loops = Loops::keep;  ///< MJCF only
  Soft soft = Soft::harden;   ///< MJCF only
  /// No mesh file is opened: meshes neither touch nor give inertia, and warnings name them. By default a mesh that is
  /// needed and cannot be had is an error.
  bool leave_out_meshes = false;
  /// Reads what links look like, as far as it is meshes: those of <visual> in URDF; in MJCF those of geoms that touch
  /// nothing, of a body without such geoms all of its own. Ones of more than 20 000 triangles are simplified. Nothing
  /// of it moves or touches.
  bool visual_meshes = false;
  /// Called once with what was read, before inertias are repaired and the Model is validated: armatures, a floating
  /// root. May be empty.
  std::function<void(Model&)> change = {};
};

/// Reads URDF or MJCF, whichever the root element says it is. An option that the format cannot use is a SettingsError,
/// here and in the functions below. Thread-safe, as they are.
LOCKSTEP_API Import import_file(const std::string& path, const ImportOptions& options = {});

/// Reads URDF (docs/importing.md has the details). Mesh files, STL or OBJ, are opened where colliders or density ask
/// for them. Throws ImportError where the text is no URDF or a mesh cannot be had, ModelError where it describes an
/// impossible mechanism: a moving body without inertia, a mimic multiplier of 0, mimics in a circle, ... Both name file
/// and line. SettingsError where a number of the options is negative, infinite or NaN, or a name is unknown. The Model
/// is validated. Thread-safe.
LOCKSTEP_API Import import_urdf_file(const std::string& path, const ImportOptions& options = {});

/// The same from text; `source` names it in errors.
LOCKSTEP_API Import import_urdf(const std::string& text, const std::string& source = "URDF text",
                                const ImportOptions& options = {});

/// Reads MJCF, MuJoCo's XML, as MuJoCo 3.3 does (docs/importing.md has the details). Files that it includes
/// or attaches must lie in its folder or in ImportOptions::file_roots. Mesh files, STL, OBJ or MSH, are opened where
/// colliders or the inertia of a moving body ask for them. Throws ImportError where the text is no MJCF, a mesh cannot
/// be had, or where its mechanism would be another one without what lockstep lacks: sums of joints that are not linear.
/// Throws ModelError where the mechanism is impossible. Both name file and line. SettingsError as above, and where the
/// keyframe or the body does not exist. What only drives or resists the mechanism and cannot be had is a warning. The
/// Model is validated. Thread-safe.
LOCKSTEP_API Import import_mjcf_file(const std::string& path, const ImportOptions& options = {});

/// The same from text, which cannot include files; `source` names it in errors.
LOCKSTEP_API Import import_mjcf(const std::string& text, const std::string& source = "MJCF text",
                                const ImportOptions& options = {});

}  // namespace lockstep
