# SPDX-License-Identifier: Apache-2.0
# Install rules and the Debian package. All files are located relative to the programs, so the installation can be moved;
# therefore `lib` has no architecture suffix.
install(TARGETS arhost arhost-inprocess EXPORT arhost RUNTIME DESTINATION bin)
install(TARGETS ${ARHOST_COMMANDS} arhost-launcher arhost-worker RUNTIME DESTINATION bin)
set_target_properties(arhost-inprocess PROPERTIES EXPORT_NAME inprocess)
install(TARGETS arhost-images LIBRARY DESTINATION lib/arhost)
# Plugins: see arhost_add_plugin.

# The SDK
install(DIRECTORY core/abi/include/ core/shading/include/ DESTINATION include)
install(TARGETS arhost-abi arhost-shading EXPORT arhost)
install(EXPORT arhost NAMESPACE arhost:: FILE arhostTargets.cmake DESTINATION lib/cmake/arhost)
include(CMakePackageConfigHelpers)
set(plugin_directory lib/arhost/plugins)
configure_package_config_file(cmake/arhostConfig.cmake.in arhostConfig.cmake INSTALL_DESTINATION lib/cmake/arhost
                              PATH_VARS plugin_directory)
# Before 1.0, minor versions may be incompatible.
write_basic_package_version_file(arhostConfigVersion.cmake COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
configure_file(cmake/arhost.pc.in arhost.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/arhostConfig.cmake ${PROJECT_BINARY_DIR}/arhostConfigVersion.cmake
              cmake/arhost_add_plugin.cmake cmake/plugin.map DESTINATION lib/cmake/arhost)
install(FILES ${PROJECT_BINARY_DIR}/arhost.pc DESTINATION share/pkgconfig) # no architecture: only headers
install(DIRECTORY sdk/ DESTINATION share/arhost PATTERN target EXCLUDE PATTERN Cargo.lock EXCLUDE)

# Examples and documentation
install(DIRECTORY config DESTINATION share/arhost PATTERN README.md EXCLUDE)
install(FILES docs/arhost.schema.json docs/devices.schema.json DESTINATION share/arhost)
set(documentation share/doc/arhost)
install(FILES LICENSE DESTINATION ${documentation} COMPONENT licence) # Debian has the text elsewhere
# The documentation has the folders of the repository, so that its relative links work: all documents, copies of the files
# that they link to, and symbolic links to the headers.
file(GLOB documents RELATIVE ${PROJECT_SOURCE_DIR} CONFIGURE_DEPENDS *.md bench/peers/*.md config/*.md docs/*.md docs/adr/*.md
     libs/*/*.md plugins/*/*.md)
set(linked docs/images)
foreach(document ${documents})
  get_filename_component(folder ${document} DIRECTORY)
  install(FILES ${document} DESTINATION ${documentation}/${folder})
  file(READ ${document} text)
  string(REPLACE "](" "\n<" text "${text}") # CMake's lists treat brackets specially
  string(REGEX MATCHALL "\n<[^<>)#: \n]+" targets "${text}")
  foreach(target ${targets})
    string(SUBSTRING ${target} 2 -1 target)
    file(REAL_PATH "./${folder}/${target}" target BASE_DIRECTORY ${PROJECT_SOURCE_DIR})
    file(RELATIVE_PATH target ${PROJECT_SOURCE_DIR} ${target})
    if(NOT target MATCHES "/include/|^\\.\\./" AND NOT target IN_LIST documents)
      list(APPEND linked ${target})
    endif()
  endforeach()
endforeach()
list(REMOVE_DUPLICATES linked)
foreach(target ${linked})
  get_filename_component(folder ${target} DIRECTORY)
  if(IS_DIRECTORY ${PROJECT_SOURCE_DIR}/${target})
    install(DIRECTORY ${target} DESTINATION ${documentation}/${folder})
  else()
    install(FILES ${target} DESTINATION ${documentation}/${folder})
  endif()
endforeach()
foreach(module abi shading)
  file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/documentation/core/${module})
  file(CREATE_LINK ../../../../../include ${PROJECT_BINARY_DIR}/documentation/core/${module}/include SYMBOLIC)
endforeach()
install(DIRECTORY ${PROJECT_BINARY_DIR}/documentation/ DESTINATION ${documentation})

# The Debian package. `lintian` accepts it (tests/sdk).
set(ARHOST_PACKAGE_CONTACT "arhost maintainers <arhost@example.org>" CACHE STRING "Maintainer of the Debian package: Name <mail>")
set(debian ${PROJECT_BINARY_DIR}/debian)
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC) # of SOURCE_DATE_EPOCH if it is set
file(CONFIGURE OUTPUT ${debian}/changelog CONTENT "arhost (${PROJECT_VERSION}) unstable; urgency=medium

  * /usr/share/doc/arhost/CHANGELOG.md lists the changes.

 -- ${ARHOST_PACKAGE_CONTACT}  ${date}
" @ONLY)
find_program(GZIP gzip REQUIRED)
execute_process(COMMAND ${GZIP} -9nf ${debian}/changelog COMMAND_ERROR_IS_FATAL ANY)
install(FILES ${debian}/changelog.gz DESTINATION ${documentation} COMPONENT debian EXCLUDE_FROM_ALL)
install(FILES cmake/debian/copyright DESTINATION ${documentation} COMPONENT debian EXCLUDE_FROM_ALL)
install(FILES cmake/debian/lintian-overrides DESTINATION share/lintian/overrides RENAME arhost COMPONENT debian EXCLUDE_FROM_ALL)
set(CPACK_INSTALL_CMAKE_PROJECTS "${PROJECT_BINARY_DIR};arhost;Unspecified;/" "${PROJECT_BINARY_DIR};arhost;debian;/")
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
                                                WORLD_EXECUTE)
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT ${ARHOST_PACKAGE_CONTACT})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "ray-traced objects over live video, and the SDK for its plugins")
set(CPACK_PACKAGE_DESCRIPTION "arhost runs trackers and ray tracers as plugins, each in its own
sandboxed process, converts the pose of a marker to the camera of the
ray tracer, and composites the ray-traced image over every frame.
.
This package contains the programs, plugins for files, cameras, ArUco
and AprilTag markers, Embree, Vulkan and Python, example scenes, and
what authors of plugins need: headers, a CMake package, templates and
documentation.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SECTION video)
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3-numpy, libvulkan1, mesa-vulkan-drivers")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "cmake, g++, cargo, gdb")
include(CPack)
