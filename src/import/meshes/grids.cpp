// SPDX-License-Identifier: Apache-2.0
#include "grids.h"

#include <fmt/format.h>
#include <png.h>

#include <csetjmp>
#include <cstdint>
#include <cstring>
#include <vector>

namespace lockstep::importer {
namespace {

template <class Number>
using Grid = Eigen::Matrix<Number, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

void require_size(long rows, long columns, long most, const FailAt& fail) {
  if (rows < 2 || columns < 2 || rows > most / columns)
    fail("byte 0", fmt::format("has {} x {} numbers", rows, columns), fmt::format("give 2 x 2 to {}", most));
}

// A PNG in memory. libpng leaves the functions that may fail by a jump, so these have no objects of their own.
class Png {
 public:
  explicit Png(std::string_view content) : rest_(content) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, fail, [](png_structp, png_const_charp) {});
    info_ = png_ ? png_create_info_struct(png_) : nullptr;
  }
  ~Png() { png_destroy_read_struct(&png_, &info_, nullptr); }
  Png(const Png&) = delete;
  Png& operator=(const Png&) = delete;

  bool read_header() {
    if (!info_ || setjmp(png_jmpbuf(png_))) return false;
    png_set_read_fn(png_, this, read);
    png_read_info(png_, info_);
    png_set_expand_gray_1_2_4_to_8(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }
  long rows() const { return png_get_image_height(png_, info_); }
  long columns() const { return png_get_image_width(png_, info_); }
  bool is_grey() const { return png_get_color_type(png_, info_) == PNG_COLOR_TYPE_GRAY; }
  int bytes() const { return png_get_bit_depth(png_, info_) == 16 ? 2 : 1; }
  bool read_rows(png_bytepp rows) {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_read_image(png_, rows);
    return true;
  }
  const char* problem() const { return problem_; }

 private:
  [[noreturn]] static void fail(png_structp png, png_const_charp text) {
    std::strncpy(static_cast<Png*>(png_get_error_ptr(png))->problem_, text, sizeof problem_ - 1);
    longjmp(png_jmpbuf(png), 1);
  }
  static void read(png_structp png, png_bytep to, std::size_t count) {
    std::string_view& rest = static_cast<Png*>(png_get_io_ptr(png))->rest_;
    if (count > rest.size()) png_error(png, "it ends too early");
    std::memcpy(to, rest.data(), count);
    rest.remove_prefix(count);
  }

  std::string_view rest_;
  png_structp png_;
  png_infop info_;
  char problem_[80] = "no memory";
};

// Pixels as they are: gamma and profiles of colour are of no account.
Eigen::MatrixXd read_png(std::string_view content, long most, const FailAt& fail) {
  Png png(content);
  const auto damaged = [&] {
    fail("byte 0", fmt::format("is a damaged PNG: {}", png.problem()), "save the image anew");
  };
  if (!png.read_header()) damaged();
  require_size(png.rows(), png.columns(), most, fail);
  if (!png.is_grey()) fail("byte 0", "is a PNG with colours or transparency", "save it as grey");
  const long rows = png.rows(), columns = png.columns(), width = png.bytes() * columns;
  std::vector<png_byte> pixels(static_cast<std::size_t>(rows * width));
  std::vector<png_bytep> lines;
  for (long row = 0; row < rows; ++row) lines.push_back(pixels.data() + row * width);
  if (!png.read_rows(lines.data())) damaged();
  Eigen::MatrixXd numbers(rows, columns);
  for (long row = 0; row < rows; ++row)
    for (long column = 0; column < columns; ++column) {
      const png_byte* const at = lines[static_cast<std::size_t>(row)] + png.bytes() * column;
      numbers(rows - 1 - row, column) = png.bytes() == 2 ? 256 * at[0] + at[1] : at[0];
    }
  return numbers;
}

}  // namespace

Eigen::MatrixXd read_grid(std::string_view content, long most, const FailAt& fail) {
  constexpr std::string_view png = "\x89PNG";
  if (content.starts_with(png)) return read_png(content, most, fail);
  std::int32_t counts[2] = {};
  if (content.size() < sizeof counts)
    fail("byte 0", "is neither a PNG nor a grid of MuJoCo's", "save it as a grey PNG");
  std::memcpy(counts, content.data(), sizeof counts);
  const long rows = counts[0], columns = counts[1];
  require_size(rows, columns, most, fail);
  const std::size_t size = sizeof counts + sizeof(float) * static_cast<std::size_t>(rows * columns);
  if (content.size() != size)
    fail("byte 0", fmt::format("has {} bytes, and {} x {} numbers take {}", content.size(), rows, columns, size),
         "save it as a grey PNG");
  Grid<float> numbers(rows, columns);
  std::memcpy(numbers.data(), content.data() + sizeof counts, size - sizeof counts);
  return numbers.cast<double>();
}

}  // namespace lockstep::importer
