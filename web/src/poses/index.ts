export { PoseView } from './poseView';
import './posePanel';
