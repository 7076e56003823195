set(headers blendshapes.hpp landmark_map.hpp morphable_model.hpp pca_model.hpp)
