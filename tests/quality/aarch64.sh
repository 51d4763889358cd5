#!/bin/sh
# The kernels on AArch64, in an emulator: the same bits as here. Wants g++-aarch64-linux-gnu, qemu-user,
# zlib1g-dev:arm64, libpng-dev:arm64, libqhull-dev:arm64, libtinyobjloader-dev and lib{tbb,fmt,tinyxml2,gtest}-dev:arm64. SPDX-License-Identifier: Apache-2.0
set -e
cd "$(dirname "$0")/../.."
cmake --preset release
cmake --build --preset release --target golden
ctest --test-dir build/release -R '^cross.aarch64$' -FS slow_programs --output-on-failure  # golden is all it needs
