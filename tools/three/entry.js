// what acqd/report/assets/arm.js uses of three.js; the rest is left out by esbuild
export {
  AmbientLight, Color, CylinderGeometry, DirectionalLight, GridHelper, Group, Matrix4, Mesh, MeshLambertMaterial,
  PerspectiveCamera, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
