# Engines to compare with. `engines`: those of MUJOCO, BULLET and SIMBODY that this machine has.
set(engines "")
if(NOT LOCKSTEP_SANITIZE)  # sanitizers are for the code of this project
  # Debian's mujocoConfig.cmake names folders that its package does not have. CMAKE_PREFIX_PATH finds other versions.
  find_path(MUJOCO_INCLUDE_DIR mujoco/mujoco.h)
  find_library(MUJOCO_LIBRARY mujoco)
  if(MUJOCO_INCLUDE_DIR AND MUJOCO_LIBRARY)
    list(APPEND engines MUJOCO)
  endif()

  find_package(PkgConfig QUIET)
  if(PkgConfig_FOUND)
    pkg_check_modules(bullet QUIET IMPORTED_TARGET bullet-float64)
  endif()
  if(bullet_FOUND)
    list(APPEND engines BULLET)
  endif()

  find_package(Simbody QUIET)
  if(Simbody_FOUND)
    list(APPEND engines SIMBODY)
  endif()
endif()

# lockstep_add_peers(target ENGINE...) adds the sources of these engines, and defines LOCKSTEP_PEER_ENGINE for all that
# link the target. The engines' headers are system headers, so they give no warnings.
function(lockstep_add_peers target)
  set(folder ${PROJECT_SOURCE_DIR}/bench/peers)
  foreach(engine ${ARGN})
    string(TOLOWER ${engine} file)
    target_sources(${target} PRIVATE ${folder}/${file}.cpp)
    target_compile_definitions(${target} PUBLIC LOCKSTEP_PEER_${engine})
  endforeach()
  if(MUJOCO IN_LIST ARGN)
    target_link_libraries(${target} PUBLIC ${MUJOCO_LIBRARY} tinyxml2::tinyxml2)
    target_include_directories(${target} SYSTEM PRIVATE ${MUJOCO_INCLUDE_DIR})
  endif()
  if(BULLET IN_LIST ARGN)
    target_link_libraries(${target} PUBLIC PkgConfig::bullet)
  endif()
  if(SIMBODY IN_LIST ARGN)
    target_link_libraries(${target} PUBLIC ${Simbody_LIBRARIES})
    target_include_directories(${target} SYSTEM PRIVATE ${Simbody_INCLUDE_DIR})
    set_source_files_properties(${folder}/simbody.cpp PROPERTIES  # Simbody's headers are not C++20
      COMPILE_OPTIONS -std=c++17 SKIP_PRECOMPILE_HEADERS ON)
  endif()
endfunction()
