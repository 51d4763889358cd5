// Which folder may know which: docs/architecture.md draws these arrows. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace {

namespace fs = std::filesystem;
using Prefixes = std::vector<std::string>;

// "std" stands for the standard library; everything else is the beginning of a path.
struct Area {
  std::string files;  // this area: the first whose prefix fits
  Prefixes may_know;  // beside itself
};

const std::vector<Area> areas = {
    {"include/lockstep/c.h", {"stdint.h"}},
    {"include/lockstep/mpi.h", {"include/lockstep/", "std", "Eigen/", "mpi.h"}},
    {"include/lockstep/", {"std", "Eigen/"}},
    {"src/model/",
     {"include/lockstep/model.h", "include/lockstep/softness.h", "include/lockstep/enums.h", "include/lockstep/error.h",
      "src/simd/curves.h", "std", "Eigen/", "libqhull_r/"}},
    {"src/files/", {"std", "fcntl.h", "sys/stat.h", "unistd.h"}},
    // The readers do not know each other.
    {"src/import/urdf/",
     {"include/lockstep/import.h", "include/lockstep/model.h", "include/lockstep/error.h", "src/model/",
      "src/import/attributes.h", "src/import/draft.h", "src/import/finish.h", "src/import/meshes/",
      "src/import/options.h", "src/import/paths.h", "src/import/repair.h", "src/import/report.h", "src/import/text.h",
      "src/import/xml.h", "std", "Eigen/", "fmt/", "tinyxml2.h"}},
    {"src/import/mjcf/",
     {"include/lockstep/import.h", "include/lockstep/model.h", "include/lockstep/error.h", "src/model/",
      "src/import/attributes.h", "src/import/draft.h", "src/import/finish.h", "src/import/folders.h",
      "src/import/meshes/", "src/import/options.h", "src/import/paths.h", "src/import/report.h", "src/import/text.h",
      "src/import/xml.h", "std", "Eigen/", "fmt/", "tinyxml2.h"}},
    {"src/import/meshes/",
     {"include/lockstep/import.h", "include/lockstep/error.h", "src/model/", "src/import/attributes.h",
      "src/import/folders.h", "src/import/paths.h", "src/import/report.h", "src/import/text.h", "src/import/xml.h",
      "src/files/", "std", "Eigen/", "fmt/", "tiny_obj_loader.h", "png.h"}},
    {"src/import/file",
     {"include/lockstep/", "src/import/paths.h", "src/import/xml.h", "src/import/mjcf/mjcf.h", "src/import/urdf/urdf.h",
      "std", "tinyxml2.h"}},
    {"src/import/",
     {"include/lockstep/import.h", "include/lockstep/model.h", "include/lockstep/error.h", "src/model/", "src/files/",
      "std", "Eigen/", "fmt/", "tinyxml2.h"}},
    // Of the importer it knows the report, and of the kernels what a Batch shows.
    {"src/export/",
     {"include/lockstep/", "src/model/", "src/import/report.h", "src/files/", "std", "Eigen/", "fmt/", "tinyxml2.h"}},
    {"src/plan/tables", {"include/lockstep/enums.h", "src/model/softness_kind.h", "src/plan/tables/", "cstdint"}},
    {"src/plan/",
     {"include/lockstep/plan.h", "include/lockstep/step.h", "include/lockstep/model.h", "include/lockstep/error.h",
      "src/model/", "src/plan/tables.h", "std", "Eigen/", "fmt/"}},
    {"src/c/", {"include/lockstep/", "std"}},
    {"src/compile/",
     {"include/lockstep/plan.h", "include/lockstep/error.h", "src/model/", "src/plan/", "src/measure/", "std", "fmt/"}},
    {"src/simd/", {"cstdint", "cstddef"}},
    // Kernels are compiled once for each instruction set, so they know no container and nobody's functions.
    {"src/kernels/tile/", {"include/lockstep/enums.h", "src/plan/tables.h", "src/simd/", "cstdint", "cstddef"}},
    {"src/kernels/dynamics/", {"src/kernels/tile/", "src/simd/"}},
    {"src/kernels/couplings/", {"src/kernels/tile/", "src/kernels/dynamics/", "src/simd/"}},
    {"src/kernels/bounds/", {"src/kernels/tile/", "src/kernels/dynamics/", "src/kernels/couplings/", "src/simd/"}},
    {"src/kernels/contacts/",
     {"src/kernels/tile/", "src/kernels/dynamics/", "src/kernels/couplings/", "src/kernels/bounds/", "src/simd/"}},
    {"src/kernels/loops/", {"src/kernels/tile/", "src/kernels/dynamics/", "src/kernels/bounds/", "src/simd/"}},
    {"src/kernels/rounds/",
     {"src/kernels/tile/", "src/kernels/dynamics/", "src/kernels/couplings/", "src/kernels/bounds/",
      "src/kernels/contacts/", "src/kernels/loops/", "src/simd/"}},
    {"src/kernels/integrators/",
     {"src/kernels/tile/", "src/kernels/dynamics/", "src/kernels/couplings/", "src/kernels/bounds/",
      "src/kernels/contacts/", "src/kernels/loops/", "src/kernels/rounds/", "src/simd/"}},
    {"src/kernels/", {"src/kernels/", "src/simd/", "src/plan/tables.h"}},
    {"src/trace/access.h", {}},
    {"src/trace/",
     {"include/lockstep/plan.h", "include/lockstep/error.h", "src/plan/", "src/kernels/", "src/simd/",
      "src/trace/access.h", "std", "fmt/"}},
    {"src/codegen/", {"include/lockstep/", "src/trace/", "src/plan/", "src/kernels/tile/", "src/simd/", "std", "fmt/"}},
    {"src/jit/run.h", {"src/jit/frame.h", "src/kernels/step.h", "src/kernels/tile/own_numbers.h"}},
    {"src/jit/frame.h", {"src/kernels/tile/routine_code.h", "src/plan/tables.h", "src/trace/access.h", "cstddef"}},
    {"src/jit/encode.cpp", {"include/lockstep/error.h", "src/jit/", "xbyak/", "std"}},
    {"src/jit/names.cpp", {"src/jit/names.h", "std", "fmt/", "elf.h", "fcntl.h", "unistd.h"}},
    {"src/jit/memory.cpp", {"src/jit/memory.h", "sys/mman.h", "unistd.h", "std"}},
    {"src/jit/",
     {"include/lockstep/error.h", "src/jit/", "src/trace/", "src/plan/", "src/simd/sincos.h", "std", "fmt/",
      "unistd.h"}},
    {"src/measure/", {"src/plan/", "src/targets/reduced_matrix.h", "src/targets/baseline.cpp", "std", "Eigen/"}},
    // What chooses among the kernels is not compiled for any of them, and may know more than they do.
    {"src/targets/dispatch",
     {"include/lockstep/batch.h", "include/lockstep/error.h", "src/targets/kernel_set.h", "src/targets/avx",
      "src/targets/baseline", "src/targets/neon", "std"}},
    {"src/targets/registry", {"include/lockstep/", "src/targets/generated_kernel.h", "std"}},
    {"src/targets/",
     {"include/lockstep/export.h", "src/kernels/", "src/plan/tables.h", "src/jit/run.h", "src/jit/frame.h", "src/simd/",
      "cstdint", "cstddef"}},
    {"src/batch/",
     {"include/lockstep/", "src/jit/compile.h", "src/jit/frame.h", "src/plan/", "src/model/", "src/simd/",
      "src/targets/", "std", "Eigen/", "fmt/", "tbb/", "sys/mman.h", "zlib.h"}},
    {"src/ranks/",
     {"include/lockstep/", "src/batch/blob", "src/files/", "std", "fmt/", "nlohmann/", "fcntl.h", "unistd.h",
      "zlib.h"}},
    {"src/reference/", {"include/lockstep/", "src/model/", "std", "Eigen/"}},
    {"src/report/",
     {"include/lockstep/", "src/plan/", "src/jit/compile.h", "src/targets/registry.h", "src/targets/reduced_matrix.h",
      "src/targets/start_gaps.h", "src/targets/baseline.cpp", "std", "Eigen/", "fmt/"}},
    {"src/view/", {"include/lockstep/", "std", "Eigen/", "fmt/", "nlohmann/"}},
    {"src/tool/",
     {"include/lockstep/", "src/view/", "src/files/", "std", "Eigen/", "fmt/", "CLI/", "nlohmann/", "fcntl.h",
      "spawn.h", "sys/", "time.h", "unistd.h"}},
};

const Area* area_of(const std::string& file) {
  for (const Area& area : areas)
    if (file.starts_with(area.files)) return &area;
  return nullptr;
}

bool is_standard(const std::string& header) {
  return header.find('/') == std::string::npos && header.find('.') == std::string::npos;
}

bool allowed(const std::string& file, const std::string& included) {
  const Area* area = area_of(file);
  if (!area) return false;
  if (area_of(included) == area) return true;
  for (const std::string& known : area->may_know)
    if (known == "std" ? is_standard(included) : included.starts_with(known)) return true;
  return false;
}

const fs::path root = LOCKSTEP_SOURCE;

// A header of this project as a path from its root, one from outside as it stands.
std::string resolved(const fs::path& file, const std::string& included) {
  for (const fs::path& folder : {file.parent_path(), root / "src", root / "include"})
    if (fs::is_regular_file(folder / included)) return fs::relative(folder / included, root).generic_string();
  return included;
}

std::vector<std::string> includes(const fs::path& file) {
  static const std::regex directive(R"(^\s*#\s*include\s*[<"]([^>"]+)[>"])");
  std::vector<std::string> found;
  std::ifstream stream(file);
  std::smatch match;
  for (std::string line; std::getline(stream, line);)
    if (std::regex_search(line, match, directive)) found.push_back(resolved(file, match[1]));
  return found;
}

TEST(Arrows, include_no_header_against_them) {
  int read = 0;
  for (const char* folder : {"src", "include"})
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".h" && extension != ".cpp") continue;
      const std::string file = fs::relative(entry.path(), root).generic_string();
      ++read;
      EXPECT_TRUE(area_of(file)) << file << " lies in no folder that the table above knows";
      for (const std::string& included : includes(entry.path()))
        EXPECT_TRUE(allowed(file, included)) << file << " must not include " << included;
    }
  EXPECT_GT(read, 100);
}

struct Symbols {
  std::set<std::string> shown, hidden, wanted;  // defined for all, defined within the library, and asked of others
};

Symbols symbols(const std::string& object) {
  Symbols all;
  FILE* pipe = popen((LOCKSTEP_READELF " -sW '" + object + "'").c_str(), "r");
  char line[8192];
  while (pipe && std::fgets(line, sizeof line, pipe)) {
    std::istringstream words(line);
    std::string number, value, size, type, binding, visibility, section, name;
    words >> number >> value >> size >> type >> binding >> visibility >> section >> name;
    if (binding != "GLOBAL" || name.empty()) continue;  // weak ones are in every object that uses them
    (section == "UND" ? all.wanted : visibility == "DEFAULT" ? all.shown : all.hidden).insert(name);
  }
  if (pipe) pclose(pipe);
  return all;
}

// The files that an object was compiled from: one, or those that CMake compiles together.
std::vector<std::string> sources(const std::string& object) {
  const std::size_t folder = object.find("lockstep.dir/") + 13;
  if (object.find("/Unity/") != std::string::npos) return includes(object.substr(0, object.size() - 2));
  const fs::path source = "src/" + object.substr(folder, object.size() - folder - 2);
  return {source.lexically_normal().generic_string()};
}

bool may_call(const std::string& file, const std::string& definer, bool is_public) {
  if (is_public && allowed(file, "include/lockstep/lockstep.h")) return true;
  if (definer == "src/model/errors.cpp" && allowed(file, "include/lockstep/error.h")) return true;  // its header
  return allowed(file, definer) || allowed(file, fs::path(definer).replace_extension(".h").string());
}

// A function may be called where its header may be included; one of the public headers where these may be. Of files
// that are compiled together each must be allowed what one of them does, and nothing tells which of them has a
// function.
TEST(Arrows, link_to_no_function_against_them) {
  std::vector<std::pair<std::vector<std::string>, Symbols>> objects;
  std::istringstream list(LOCKSTEP_OBJECTS);
  for (std::string object; std::getline(list, object, ',');) objects.emplace_back(sources(object), symbols(object));
  std::map<std::string, const std::vector<std::string>*> shown, hidden;  // where they are defined
  std::size_t count = 0;
  for (const auto& [files, own] : objects) {
    count += files.size();
    for (const std::string& file : files)
      EXPECT_EQ(area_of(file), area_of(files.front())) << file << " is compiled together with " << files.front();
    for (const std::string& name : own.shown) shown[name] = &files;
    for (const std::string& name : own.hidden) hidden[name] = &files;
  }
  EXPECT_GT(count, 100u);
  EXPECT_GT(shown.size(), 30u);
  EXPECT_GT(hidden.size(), 100u);
  for (const auto& [files, own] : objects)
    for (const std::string& name : own.wanted) {
      const bool is_public = shown.contains(name);
      if (!is_public && !hidden.contains(name)) continue;  // of another library
      for (const std::string& file : files)
        for (const std::string& definer : *(is_public ? shown : hidden)[name])
          EXPECT_TRUE(may_call(file, definer, is_public)) << file << " must not call " << name << " of " << definer;
    }
}

TEST(Arrows, forbid_what_they_should) {
  EXPECT_FALSE(allowed("src/kernels/step.h", "vector"));
  EXPECT_FALSE(allowed("src/kernels/step.h", "Eigen/Core"));
  EXPECT_FALSE(allowed("src/kernels/step.h", "src/plan/program.h"));
  EXPECT_FALSE(allowed("src/kernels/dynamics/frame.h", "src/kernels/couplings/direct.h"));
  EXPECT_FALSE(allowed("src/kernels/couplings/direct.h", "src/kernels/bounds/active_set.h"));
  EXPECT_FALSE(allowed("src/simd/wide.h", "cmath"));
  EXPECT_FALSE(allowed("src/targets/avx2.cpp", "src/targets/dispatch.h"));
  EXPECT_FALSE(allowed("src/targets/avx2.cpp", "include/lockstep/batch.h"));
  EXPECT_FALSE(allowed("src/compile/compile.cpp", "tbb/parallel_for.h"));
  EXPECT_FALSE(allowed("src/plan/bodies/bodies.cpp", "src/kernels/step.h"));
  EXPECT_FALSE(allowed("src/plan/bodies/bodies.cpp", "src/measure/inertia_at_start.cpp"));
  EXPECT_FALSE(allowed("src/model/model.cpp", "include/lockstep/plan.h"));
  EXPECT_FALSE(allowed("src/reference/step.cpp", "src/kernels/step.h"));
  EXPECT_FALSE(allowed("src/batch/batch.cpp", "src/tool/tool.h"));
  EXPECT_FALSE(allowed("include/lockstep/batch.h", "src/plan/tables.h"));
  EXPECT_TRUE(allowed("src/kernels/step.h", "src/kernels/tile/tile.h"));
  EXPECT_TRUE(allowed("src/kernels/tile/tile.h", "src/plan/tables.h"));
}

TEST(Arrows, read_the_includes_of_a_file) {
  const std::vector<std::string> found = includes(root / "src/kernels/step.h");
  EXPECT_EQ(found.front(), "src/kernels/audit.h");
  EXPECT_TRUE(std::find(found.begin(), found.end(), "src/kernels/integrators/euler.h") != found.end());
}

}  // namespace
