// Files of meshes and of heights. The first byte names the format: s(tl), o(bj), m(sh), g(rid).
// SPDX-License-Identifier: Apache-2.0
#include <stdexcept>

#include "fuzz.h"
#include "import/meshes/formats.h"
#include "import/meshes/grids.h"
#include "import/meshes/solid.h"

using namespace lockstep;

namespace {

// What importers make of a mesh. They say by std::invalid_argument what is wrong with it.
template <class Use>
void made(Use use) {
  try {
    use();
  } catch (const std::invalid_argument&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view content(reinterpret_cast<const char*>(data + 1), size - 1);
  const importer::FailAt fail = [](const std::string& place, const std::string& rule, const std::string& remedy) {
    throw ImportError(place, rule, remedy);
  };
  fuzz::taken([&] {
    if (data[0] % 4 == 3) {
      importer::read_grid(content, 10000, fail);
      return;
    }
    const auto read = data[0] % 4 == 0   ? importer::read_stl
                      : data[0] % 4 == 1 ? importer::read_obj
                                         : importer::read_msh;
    const importer::Solid solid(read(content, fail));
    if (solid.vertices().cols() > 2000) return;
    for (const Fit fit : {Fit::hull, Fit::box, Fit::capsule})
      made([&] { solid.fitted(fit, 8 + static_cast<int>(size % 57)); });
    for (const auto rule :
         {importer::MeshRule::convex, importer::MeshRule::exact, importer::MeshRule::legacy, importer::MeshRule::shell})
      made([&] { solid.inertia(rule); });
    made([&] { solid.share_of_hull(); });
  });
  return 0;
}
