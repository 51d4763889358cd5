// Which folder may know which: docs/architecture.md draws these arrows. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
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
    {"include/lockstep/", {"std", "Eigen/"}},
    {"src/model/", {"include/lockstep/model.h", "include/lockstep/error.h", "std", "Eigen/"}},
    {"src/import/",
     {"include/lockstep/import.h", "include/lockstep/model.h", "include/lockstep/error.h", "src/model/", "std", "Eigen/",
      "fmt/", "tinyxml2.h"}},
    {"src/plan/",
     {"include/lockstep/plan.h", "include/lockstep/step.h", "include/lockstep/model.h", "include/lockstep/error.h",
      "src/model/", "std", "Eigen/", "fmt/"}},
    {"src/simd/", {"cstdint", "cstddef"}},
    {"src/kernels/", {"src/simd/", "src/plan/tables.h", "src/plan/operations.h", "cstdint", "cstddef"}},
    // What chooses among the kernels is not compiled for any of them, and may know more than they do.
    {"src/targets/dispatch", {"include/lockstep/batch.h", "include/lockstep/error.h", "src/targets/kernel_set.h", "std"}},
    {"src/targets/registry", {"include/lockstep/", "src/targets/generated_kernel.h", "std"}},
    {"src/targets/", {"src/kernels/", "src/plan/tables.h", "src/plan/operations.h", "src/simd/", "cstdint", "cstddef"}},
    {"src/generate/", {"include/lockstep/", "src/plan/", "src/kernels/", "src/simd/", "std", "fmt/"}},
    {"src/batch/", {"include/lockstep/", "src/generate/list.h", "src/plan/", "src/targets/", "std", "Eigen/", "tbb/", "sys/mman.h"}},
    {"src/reference/", {"include/lockstep/", "src/model/", "std", "Eigen/"}},
    {"src/report/", {"include/lockstep/", "src/plan/", "src/kernels/", "src/simd/", "src/targets/registry.h", "src/generate/list.h", "std",
      "Eigen/", "fmt/"}},
    {"src/tool/", {"include/lockstep/", "std", "Eigen/", "fmt/", "CLI/", "nlohmann/", "fcntl.h", "spawn.h", "sys/",
                   "time.h", "unistd.h"}},
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

TEST(Arrows, EveryIncludeFollowsThem) {
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
  EXPECT_GT(read, 60);
}

TEST(Arrows, ForbiddenOnesAreSeen) {
  EXPECT_FALSE(allowed("src/kernels/step.h", "vector"));
  EXPECT_FALSE(allowed("src/kernels/step.h", "Eigen/Core"));
  EXPECT_FALSE(allowed("src/kernels/step.h", "src/plan/program.h"));
  EXPECT_FALSE(allowed("src/simd/wide.h", "cmath"));
  EXPECT_FALSE(allowed("src/targets/avx2.cpp", "src/targets/dispatch.h"));
  EXPECT_FALSE(allowed("src/targets/avx2.cpp", "include/lockstep/batch.h"));
  EXPECT_FALSE(allowed("src/plan/compile.cpp", "tbb/parallel_for.h"));
  EXPECT_FALSE(allowed("src/plan/compile.cpp", "src/kernels/step.h"));
  EXPECT_FALSE(allowed("src/model/model.cpp", "include/lockstep/plan.h"));
  EXPECT_FALSE(allowed("src/reference/step.cpp", "src/kernels/step.h"));
  EXPECT_FALSE(allowed("src/batch/batch.cpp", "src/tool/tool.h"));
  EXPECT_FALSE(allowed("include/lockstep/batch.h", "src/plan/tables.h"));
  EXPECT_TRUE(allowed("src/kernels/step.h", "src/kernels/tile.h"));
  EXPECT_TRUE(allowed("src/kernels/tile.h", "src/plan/tables.h"));
}

TEST(Arrows, IncludesAreRead) {
  const std::vector<std::string> found = includes(root / "src/kernels/tile.h");
  EXPECT_EQ(found, (std::vector<std::string>{"src/plan/tables.h", "src/simd/vec3.h", "src/kernels/lanes.h"}));
}

}  // namespace
